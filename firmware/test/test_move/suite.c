// The specification in tests/firmware/test_move.c as PlatformIO wants it: in a folder of its own.
#include "../../../tests/firmware/test_move.c" // all of it
