// One wheel's speed loop: feedforward, and corrections from what the wheel does, in integers.
//
//   speed = setpoint + proportional/velocity * error + acceleration/velocity * change of setpoint - drift
//   duty  = (sign(setpoint) * static + velocity * speed) * full battery / battery
//
// Speeds are in sixteenths of mm/s ("q4"); duty is a signed fraction of full voltage, 32767 = 1. The
// feedforward does most of the work. `drift`, how much faster the wheel runs than told, is learned between
// and at edges (wheel.h); it is the loop's integral, takes up what two motors differ by, and is forgotten
// when the setpoint becomes zero or changes its sign. A setpoint of zero is no control at all: duty zero. The
// duty never opposes the setpoint.
//
// Limits. A wheel that does not turn at all is pushed by the integral up to static + 3/4 integral_limit; more
// than that would be let loose when it comes free, and is what a wheel with a dead encoder may be driven too
// fast by. While the duty is at its limit, or the wheel is held, nothing winds up.
#ifndef MOTOR_H
#define MOTOR_H

#include <stdint.h> // integers of known width

#include "encoder.h" // what it is fed with
#include "wheel.h"   // place, speed and drift

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
    struct wheel wheel;
    int16_t static_duty; // as in the gains
    int16_t velocity_q8;
    int16_t duty_limit;
    uint16_t battery_full_mv;
    uint16_t proportional_q8;  // of an error that is added to the speed, times 256
    uint16_t acceleration_q8;  // of the setpoint's change in a tick
    int16_t hard_q4;           // speed whose duty pushes hard
    uint16_t compensation_q12; // duty is multiplied by this, times 4096
    int16_t setpoint_q4;       // of the last tick
    int16_t duty;              // put out last tick
};

// All gains zero or positive. The wheel stands.
void motor_init(struct motor *motor, const struct motor_gains *gains);

// Every tick, driven or not, after encoder_update(): what the wheel has done.
void motor_sense(struct motor *motor, const struct encoder *encoder);

// Travel of the wheel since the start, micrometres, between counts too.
int32_t motor_travel_um(const struct motor *motor);

// Motor off: forget what was learned, so that the next start is like the first. The wheel goes on being
// sensed.
void motor_release(struct motor *motor);

// One tick, after motor_sense(). Returns the duty, within duty_limit.
//
// battery_mv: as measured, 0 if it cannot be. It scales the duty by 0.8 to 1.5: as measured when the wheel
// sets out, later following by 0.05 % a tick, so that the battery's answer to the motor does not come back to
// it.
int16_t motor_update(struct motor *motor, int16_t setpoint_q4, uint16_t battery_mv);

#endif
