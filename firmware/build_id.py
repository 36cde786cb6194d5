"""The build id: names the sources that a firmware was built from, and is told in HELLO.

Run as a program it prints the compiler flag; as PlatformIO's extra script it sets it.
"""

from __future__ import annotations

import zlib
from pathlib import Path


def build_id(firmware: Path) -> int:
    """CRC-32 over the names and contents of all sources and platformio.ini."""
    crc = 0
    for path in [*sorted(firmware.glob("src/**/*.[chS]")), firmware / "platformio.ini"]:
        crc = zlib.crc32(path.relative_to(firmware).as_posix().encode() + b"\0", crc)
        crc = zlib.crc32(path.read_bytes().replace(b"\r\n", b"\n"), crc)
    return crc


if "Import" in globals():  # inside PlatformIO, which gives scripts its own names and no __file__
    Import("env")  # type: ignore[name-defined] # noqa: F821
    env.Append(  # type: ignore[name-defined] # noqa: F821
        CPPDEFINES=[("ROBOT_BUILD_ID", f"0x{build_id(Path(env['PROJECT_DIR'])):08X}ul")]  # noqa: F821
    )
elif __name__ == "__main__":
    print(f"-DROBOT_BUILD_ID=0x{build_id(Path(__file__).parent):08X}ul")
