// The host's frames, for every suite here.
#include "../../tests/firmware/host_frames.c" // all of it
