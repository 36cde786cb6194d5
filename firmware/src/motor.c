// One wheel's speed loop: feedforward, and corrections from what the wheel does, in integers.
#include "motor.h" // this file's manual

#include <stdbool.h> // bool

#include "within.h" // within

#define SPEED_MOST_Q4 INT16_MAX
// The integral as a share of an error in speed learned at an edge: it acts over 40 ticks.
#define INTEGRAL_TICKS 40u

#define UNCOMPENSATED_Q12 4096u
#define COMPENSATION_LEAST_Q12 3277u // 0.8
#define COMPENSATION_MOST_Q12 6144u  // 1.5
#define COMPENSATION_STEP_Q12 2u

static uint32_t at_most(uint32_t value, uint32_t most)
{
    return value < most ? value : most;
}

void motor_init(struct motor *motor, const struct motor_gains *gains)
{
    uint32_t velocity = gains->velocity_q8 > 0 ? (uint32_t)gains->velocity_q8 : 1u;
    uint32_t limit_q4 = at_most((uint32_t)gains->integral_limit * 256u / velocity, WHEEL_SPEED_Q4);
    uint32_t learn_q8 = (uint32_t)gains->integral_q12 * (uint32_t)(INTEGRAL_TICKS * 16u) / velocity;
    *motor = (struct motor){
        .static_duty = gains->static_duty,
        .velocity_q8 = gains->velocity_q8,
        .duty_limit = gains->duty_limit,
        .battery_full_mv = gains->battery_full_mv,
        .proportional_q8 = (uint16_t)at_most((uint32_t)gains->proportional_q8 * 256u / velocity, UINT16_MAX),
        .acceleration_q8 = (uint16_t)at_most((uint32_t)gains->acceleration_q8 * 256u / velocity, UINT16_MAX),
        .hard_q4 = (int16_t)(limit_q4 / 4u * 3u),
        .compensation_q12 = UNCOMPENSATED_Q12,
    };
    wheel_init(&motor->wheel, (uint8_t)at_most(learn_q8, UINT8_MAX), (int16_t)limit_q4);
}

void motor_sense(struct motor *motor, const struct encoder *encoder)
{
    wheel_update(&motor->wheel, encoder);
}

int32_t motor_travel_um(const struct motor *motor)
{
    return wheel_travel_um(&motor->wheel);
}

void motor_release(struct motor *motor)
{
    motor->wheel.told_q4 = 0;
    motor->setpoint_q4 = 0;
    motor->duty = 0;
}

// --- Battery ---------------------------------------------------------------------------------------

static void follow_battery(struct motor *motor, uint16_t battery_mv, bool at_once)
{
    if (motor->battery_full_mv == 0 || battery_mv == 0) {
        motor->compensation_q12 = UNCOMPENSATED_Q12;
        return;
    }
    uint32_t full = (uint32_t)motor->battery_full_mv * 4096u;
    uint16_t now = motor->compensation_q12;
    if (at_once)
        now = (uint16_t)at_most(full / battery_mv, UINT16_MAX);
    else if ((uint32_t)now * battery_mv < full)
        now = (uint16_t)(now + COMPENSATION_STEP_Q12);
    else if ((uint32_t)(now - COMPENSATION_STEP_Q12) * battery_mv >= full)
        now = (uint16_t)(now - COMPENSATION_STEP_Q12);
    if (now < COMPENSATION_LEAST_Q12)
        now = COMPENSATION_LEAST_Q12;
    motor->compensation_q12 = now < COMPENSATION_MOST_Q12 ? now : COMPENSATION_MOST_Q12;
}

// --- Control ---------------------------------------------------------------------------------------

// Speed to ask of the feedforward, before what the wheel is known to drift.
static int32_t speed_to_tell(const struct motor *motor, int16_t setpoint_q4, int32_t change_q4)
{
    int32_t error = 0; // of a wheel that is held, nothing can be said
    if (motor->wheel.stuck < WHEEL_STUCK_TICKS)
        error = within((int32_t)setpoint_q4 - wheel_speed_q4(&motor->wheel), INT16_MAX);
    int32_t speed = setpoint_q4 + error * motor->proportional_q8 / 256
                  + within(change_q4, INT16_MAX) * motor->acceleration_q8 / 256;
    return within(speed, WHEEL_SPEED_Q4);
}

int16_t motor_update(struct motor *motor, int16_t setpoint_q4, uint16_t battery_mv)
{
    int16_t before_q4 = motor->setpoint_q4;
    int8_t direction = setpoint_q4 > 0 ? 1 : -1;
    if (setpoint_q4 == 0) {
        motor_release(motor);
        return 0;
    }
    bool sets_out = before_q4 == 0 || (before_q4 > 0) != (setpoint_q4 > 0);
    if (sets_out)
        wheel_start(&motor->wheel, direction);
    follow_battery(motor, battery_mv, sets_out);
    motor->setpoint_q4 = setpoint_q4;

    int32_t told = speed_to_tell(motor, setpoint_q4, sets_out ? setpoint_q4 : setpoint_q4 - before_q4);
    int32_t speed = within(told - motor->wheel.drift_q12 / 256, SPEED_MOST_Q4);
    if (speed * direction < 0)
        speed = 0;
    int32_t duty = motor->velocity_q8 * speed / 256 + (int32_t)(direction * motor->static_duty);
    duty = within(duty, 2 * (int32_t)MOTOR_DUTY_FULL) * motor->compensation_q12 / 4096;
    motor->wheel.full = duty > motor->duty_limit || duty < -motor->duty_limit;
    motor->wheel.hard = speed * direction >= motor->hard_q4;
    motor->wheel.told_q4 = (int16_t)(told * direction > 0 ? told : direction);
    motor->duty = (int16_t)within(duty, motor->duty_limit);
    return motor->duty;
}
