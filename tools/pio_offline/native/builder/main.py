"""SCons script of the stand-in platform for this machine: C files to a program."""

from SCons.Script import Default, DefaultEnvironment

env = DefaultEnvironment()
env.Replace(CC="gcc", CXX="g++", AR="gcc-ar", RANLIB="gcc-ranlib", LINK="gcc")
Default(env.BuildProgram())
