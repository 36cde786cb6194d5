// One wheel's speed loop: feedforward and PI in, duty out, in integers.
//
//   duty = sign(setpoint) * static + velocity * setpoint + proportional * error + integral
//
// Speeds are in sixteenths of mm/s ("q4"); duty is a signed fraction of full voltage, 32767 = 1. The
// feedforward does most of the work, since the speed estimate is late at low speed; the integral takes up
// battery sag and the difference between two motors. A setpoint of zero is no control at all: duty zero,
// integral forgotten.
#ifndef MOTOR_H
#define MOTOR_H

#include <stdint.h> // integers of known width

enum { MOTOR_DUTY_FULL = 32767 };

struct motor_gains {
    int16_t static_duty;      // duty that just overcomes friction
    int16_t velocity_q8;      // duty per q4 speed, times 256
    int16_t acceleration_q8;  // duty per q4 change of the setpoint in one tick, times 256
    int16_t proportional_q8;  // duty per q4 speed error, times 256
    int16_t integral_q12;     // duty per q4 speed error and tick, times 4096
    int16_t integral_limit;   // duty the integral alone may reach
    int16_t duty_limit;       // duty never exceeded either way, 0 to MOTOR_DUTY_FULL
    uint16_t battery_full_mv; // at which the duties above hold; 0: whatever the battery, they hold
};

struct motor {
    struct motor_gains gains;
    int32_t integral_q12; // duty times 4096
    int16_t setpoint_q4;  // of the last tick
    int16_t duty;         // put out last tick
};

// All gains zero or positive.
void motor_init(struct motor *motor, const struct motor_gains *gains);

// Motors off: forget the past, so that the next start is like the first.
void motor_release(struct motor *motor);

// One tick. Returns the duty, within duty_limit.
//
// Anti-windup: while the duty is at its limit the integral may shrink the excess but not add to it.
//
// battery_mv: as measured, 0 if it cannot be.
int16_t motor_update(struct motor *motor, int16_t setpoint_q4, int16_t speed_q4, uint16_t battery_mv);

#endif
