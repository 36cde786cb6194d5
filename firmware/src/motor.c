// One wheel's speed loop: feedforward and PI in integers.
#include "motor.h" // this file's manual

#include <stdbool.h> // bool

static int32_t clamp(int32_t value, int32_t limit)
{
    if (value > limit)
        return limit;
    return value < -limit ? -limit : value;
}

void motor_init(struct motor *motor, const struct motor_gains *gains)
{
    *motor = (struct motor){.gains = *gains};
}

void motor_release(struct motor *motor)
{
    motor->integral_q12 = 0;
    motor->setpoint_q4 = 0;
    motor->duty = 0;
}

int16_t motor_update(struct motor *motor, int16_t setpoint_q4, int16_t speed_q4, uint16_t battery_mv)
{
    (void)battery_mv;
    const struct motor_gains *gains = &motor->gains;
    bool turned = (setpoint_q4 > 0 && motor->setpoint_q4 < 0) || (setpoint_q4 < 0 && motor->setpoint_q4 > 0);
    if (setpoint_q4 == 0 || turned)
        motor_release(motor); // what the integral learned was for the other direction
    motor->setpoint_q4 = setpoint_q4;
    if (setpoint_q4 == 0)
        return 0;

    int32_t error = clamp((int32_t)setpoint_q4 - speed_q4, INT16_MAX);
    int32_t direct = (int32_t)gains->velocity_q8 * setpoint_q4 / 256
                   + (int32_t)gains->proportional_q8 * error / 256
                   + (setpoint_q4 > 0 ? gains->static_duty : -gains->static_duty);

    int32_t integral = clamp(motor->integral_q12 + gains->integral_q12 * error,
                             (int32_t)gains->integral_limit * 4096);
    int32_t wanted = direct + integral / 4096;
    bool pushes_further = (wanted > gains->duty_limit && error > 0)
                       || (wanted < -gains->duty_limit && error < 0);
    if (pushes_further)
        wanted = direct + motor->integral_q12 / 4096;
    else
        motor->integral_q12 = integral;

    motor->duty = (int16_t)clamp(wanted, gains->duty_limit);
    return motor->duty;
}
