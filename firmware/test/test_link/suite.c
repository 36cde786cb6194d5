// The specification in tests/firmware/test_link.c as PlatformIO wants it: in a folder of its own.
#include "../../../tests/firmware/test_link.c" // all of it
