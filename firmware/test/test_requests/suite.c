// The specification in tests/firmware/test_requests.c as PlatformIO wants it: in a folder of its own.
#include "../../../tests/firmware/test_requests.c" // all of it
