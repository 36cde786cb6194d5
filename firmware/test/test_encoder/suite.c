// The specification in tests/firmware/test_encoder.c as PlatformIO wants it: in a folder of its own.
#include "../../../tests/firmware/test_encoder.c" // all of it
