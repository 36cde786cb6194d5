// The specification in tests/firmware/test_wheel.c as PlatformIO wants it: in a folder of its own.
#include "../../../tests/firmware/test_wheel.c" // all of it
