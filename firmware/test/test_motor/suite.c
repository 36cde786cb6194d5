// The specification in tests/firmware/test_motor.c as PlatformIO wants it: in a folder of its own.
#include "../../../tests/firmware/test_motor.c" // all of it
