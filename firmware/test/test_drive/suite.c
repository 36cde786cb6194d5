// The specification in tests/firmware/test_drive.c as PlatformIO wants it: in a folder of its own.
#include "../../../tests/firmware/test_drive.c" // all of it
