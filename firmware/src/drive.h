// Two wheels: a body velocity becomes two wheel speeds, limited in size and in rate of change.
//
// v is forward, omega is positive to the right: the left wheel is then the faster one. A command beyond what
// a wheel can do is scaled down as a whole, so the robot drives the commanded curve, only slower. The ramp
// moves both wheel setpoints together, so that they arrive at the same tick.
#ifndef DRIVE_H
#define DRIVE_H

#include <stdint.h> // integers of known width

enum { DRIVE_LEFT, DRIVE_RIGHT, DRIVE_SIDES };

struct drive_limits {
    int32_t track_um; // distance between the wheels' contact points, 125 to 1000000
    int16_t speed_q4; // fastest a wheel may be asked to go, sixteenths of mm/s
    int16_t step_q4;  // most a wheel's setpoint may change in one tick, at least 1
};

struct drive {
    struct drive_limits limits;
    int16_t target_q4[DRIVE_SIDES];   // where the ramp is going
    int16_t setpoint_q4[DRIVE_SIDES]; // where it is
};

void drive_init(struct drive *drive, const struct drive_limits *limits);

// Set the velocity to approach.
void drive_command(struct drive *drive, int16_t v_mm_s, int16_t omega_mrad_s);

// The wheels follow other setpoints for now, those of a move: the ramp goes on from there.
void drive_take_over(struct drive *drive, const int16_t setpoint_q4[DRIVE_SIDES]);

// Forget target and ramp: both setpoints are zero at once.
void drive_release(struct drive *drive);

// One tick of the ramp.
void drive_update(struct drive *drive);

#endif
