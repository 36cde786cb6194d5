// The firmware's parts behind functions of plain numbers, for Python: structs stay on this side.
#include <stdlib.h> // calloc

#include "drive.h"      // wheel setpoints
#include "encoder.h"    // counts and speeds
#include "motor.h"      // wheel control
#include "supervisor.h" // permission

// --- Encoder ---------------------------------------------------------------------------------------

struct shim_encoder {
    struct encoder_edges edges;
    struct encoder encoder;
};

struct shim_encoder *shim_encoder_new(uint8_t pins, uint16_t um_per_count)
{
    struct shim_encoder *shim = calloc(1, sizeof *shim);
    encoder_edges_init(&shim->edges, pins);
    encoder_init(&shim->encoder, &shim->edges, um_per_count);
    return shim;
}

void shim_encoder_edge(struct shim_encoder *shim, uint8_t pins, uint32_t now_us)
{
    encoder_edge(&shim->edges, pins, (uint16_t)(now_us / ENCODER_STAMP_US));
}

void shim_encoder_update(struct shim_encoder *shim, uint32_t now_us)
{
    encoder_update(&shim->encoder, &shim->edges, now_us);
}

int32_t shim_encoder_count(struct shim_encoder *shim)
{
    return shim->encoder.count;
}

uint16_t shim_encoder_illegal(struct shim_encoder *shim)
{
    return shim->encoder.illegal;
}

int16_t shim_encoder_speed_q4(struct shim_encoder *shim)
{
    return shim->encoder.speed_q4;
}

uint32_t shim_encoder_edge_age_us(struct shim_encoder *shim)
{
    return shim->encoder.edge_age_us;
}

// --- Motor -----------------------------------------------------------------------------------------

struct motor *shim_motor_new(int16_t static_duty, int16_t velocity_q8, int16_t proportional_q8,
                             int16_t integral_q12, int16_t integral_limit, int16_t duty_limit)
{
    struct motor_gains gains = {
        .static_duty = static_duty,   .velocity_q8 = velocity_q8,       .proportional_q8 = proportional_q8,
        .integral_q12 = integral_q12, .integral_limit = integral_limit, .duty_limit = duty_limit,
    };
    struct motor *motor = calloc(1, sizeof *motor);
    motor_init(motor, &gains);
    return motor;
}

void shim_motor_sense(struct motor *motor, struct shim_encoder *shim)
{
    motor_sense(motor, &shim->encoder);
}

void shim_motor_set_speed_q4(struct motor *motor, int16_t speed_q4)
{
    motor->wheel.speed_q12 = speed_q4 * INT32_C(256);
}

int32_t shim_motor_drift_q12(struct motor *motor)
{
    return motor->wheel.drift_q12;
}

// --- Drive -----------------------------------------------------------------------------------------

struct drive *shim_drive_new(int32_t track_um, int16_t speed_q4, int16_t step_q4)
{
    struct drive_limits limits = {track_um, speed_q4, step_q4};
    struct drive *drive = calloc(1, sizeof *drive);
    drive_init(drive, &limits);
    return drive;
}

int16_t shim_drive_target_q4(struct drive *drive, uint8_t side)
{
    return drive->target_q4[side];
}

int16_t shim_drive_setpoint_q4(struct drive *drive, uint8_t side)
{
    return drive->setpoint_q4[side];
}

// --- Supervisor ------------------------------------------------------------------------------------

struct supervisor *shim_supervisor_new(uint32_t boot_nonce, uint16_t battery_min_mv, uint8_t reset_cause)
{
    struct supervisor *supervisor = calloc(1, sizeof *supervisor);
    supervisor_init(supervisor, boot_nonce, reset_cause);
    supervisor_watch_battery(supervisor, battery_min_mv);
    return supervisor;
}

void shim_supervisor_tick(struct supervisor *supervisor, uint32_t now_us, uint16_t battery_mv,
                          uint8_t estop_pressed, uint8_t wheels_still, uint8_t wheels)
{
    struct supervisor_senses senses = {battery_mv, estop_pressed, wheels_still, wheels};
    supervisor_tick(supervisor, now_us, &senses);
}

uint8_t shim_supervisor_state(struct supervisor *supervisor)
{
    return supervisor->state;
}

uint8_t shim_supervisor_fault(struct supervisor *supervisor)
{
    return supervisor->fault;
}

uint8_t shim_supervisor_may_run(struct supervisor *supervisor)
{
    return supervisor_may_run(supervisor);
}

uint8_t shim_supervisor_coasts(struct supervisor *supervisor)
{
    return supervisor_coasts(supervisor);
}
