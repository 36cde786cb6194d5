// The hardware of variables, for every suite here.
#include "../../tests/firmware/fake_hal.c" // all of it
