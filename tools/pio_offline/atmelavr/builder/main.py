"""SCons script of the stand-in platform: C files to ELF to hex, and the upload."""

# SCons runs this file with its own names; none of them can be imported.
# pyright: reportUndefinedVariable=false

import sys
from os.path import join

from SCons.Script import AlwaysBuild, Builder, Default, DefaultEnvironment

env = DefaultEnvironment()
board = env.BoardConfig()
sys.path.insert(0, join(env.PioPlatform().get_dir(), "builder"))
import bare  # noqa: E402

mcu = f"-mmcu={board.get('build.mcu')}"
env.Replace(
    AR="avr-gcc-ar",
    AS="avr-as",
    CC="avr-gcc",
    CXX="avr-g++",
    LINK="avr-gcc",
    OBJCOPY="avr-objcopy",
    RANLIB="avr-gcc-ranlib",
    SIZETOOL="avr-size",
    SIZEPROGREGEXP=r"^(?:\.text|\.data|\.bootloader)\s+(\d+).*",
    SIZEDATAREGEXP=r"^(?:\.data|\.bss|\.noinit)\s+(\d+).*",
    SIZECHECKCMD="$SIZETOOL -A -d $SOURCES",
    SIZEPRINTCMD="$SIZETOOL --mcu=$BOARD_MCU -C -d $SOURCES",
    PROGNAME="firmware",
    PROGSUFFIX=".elf",
    UPLOADER="avrdude",
    UPLOADERFLAGS=[
        *("-p", "$BOARD_MCU", "-C", "/etc/avrdude.conf"),
        *("-c", "$UPLOAD_PROTOCOL", "-b", "$UPLOAD_SPEED", "-D"),
    ],
)
env.Append(
    ASFLAGS=["-x", "assembler-with-cpp", mcu, *bare.ALL],
    CFLAGS=bare.C,
    CCFLAGS=[mcu, *bare.ALL],
    CPPDEFINES=[("F_CPU", "$BOARD_F_CPU")],
    LINKFLAGS=[mcu, *bare.LINK],
    LIBS=bare.LIBRARIES,
    BUILDERS={
        "Hex": Builder(
            action=env.VerboseAction("$OBJCOPY -O ihex -R .eeprom $SOURCES $TARGET", "Building $TARGET"),
            suffix=".hex",
        )
    },
)

elf = env.BuildProgram()
hex_file = env.Hex(join("$BUILD_DIR", "${PROGNAME}"), elf)
AlwaysBuild(env.Alias("size", elf, env.VerboseAction("$SIZEPRINTCMD", "Calculating size $SOURCE")))
AlwaysBuild(
    env.Alias(
        "upload",
        hex_file,
        [
            env.VerboseAction(env.AutodetectUploadPort, "Looking for upload port..."),
            env.VerboseAction(
                '"$UPLOADER" $UPLOADERFLAGS -P "$UPLOAD_PORT" -U flash:w:$SOURCES:i', "Uploading $SOURCE"
            ),
        ],
    )
)
env.Alias("checkprogsize", elf)
Default(hex_file)
