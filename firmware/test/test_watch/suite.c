// The specification in tests/firmware/test_watch.c as PlatformIO wants it: in a folder of its own.
#include "../../../tests/firmware/test_watch.c" // all of it
