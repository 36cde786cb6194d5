// The motor driver, a TB6612FNG: two PWM outputs at 20 kHz, two direction pins each, one standby pin.
//
// hal_motor_set() and hal_motor_coast() are here. Both direction pins high shorts the motor whatever the PWM
// does, so that zero duty takes hold at once and not at the end of a PWM period.
#ifndef AVR_MOTORS_H
#define AVR_MOTORS_H

#include <stdbool.h> // bool

// Every driver pin an output and low: the driver in standby. Called first thing after reset.
void motors_safe(void);

// PWM running at zero duty, both motors shorted, driver awake.
void motors_init(void);

// The PWM timer is still set up as motors_init() left it.
bool motors_intact(void);

#endif
