// The specification in tests/firmware/test_supervisor.c as PlatformIO wants it: in a folder of its own.
#include "../../../tests/firmware/test_supervisor.c" // all of it
