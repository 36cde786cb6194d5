// The robot that rolls, for every suite here.
#include "../../tests/firmware/rolling_robot.c" // all of it
