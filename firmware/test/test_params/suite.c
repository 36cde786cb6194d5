// The specification in tests/firmware/test_params.c as PlatformIO wants it: in a folder of its own.
#include "../../../tests/firmware/test_params.c" // all of it
