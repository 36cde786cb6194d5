"""The real platform's compiler and linker flags for a program without a framework, as of atmelavr 5.2.0."""

C = ["-std=gnu11", "-fno-fat-lto-objects"]
ALL = ["-Os", "-Wall", "-ffunction-sections", "-fdata-sections", "-flto"]
LINK = ["-Os", "-Wl,--gc-sections", "-flto", "-fuse-linker-plugin"]
LIBRARIES = ["m"]
