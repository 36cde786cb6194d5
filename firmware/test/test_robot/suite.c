// The specification in tests/firmware/test_robot.c as PlatformIO wants it: in a folder of its own.
#include "../../../tests/firmware/test_robot.c" // all of it
