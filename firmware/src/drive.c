// Two wheels: body velocity to wheel setpoints, saturation that keeps the curve, ramp.
#include "drive.h" // this file's manual

static int32_t magnitude(int32_t value)
{
    return value < 0 ? -value : value;
}

static int32_t larger_magnitude(const int32_t pair[DRIVE_SIDES])
{
    int32_t left = magnitude(pair[DRIVE_LEFT]), right = magnitude(pair[DRIVE_RIGHT]);
    return left > right ? left : right;
}

// Scale both values by one factor, so that neither exceeds the limit.
static void limit_pair(int32_t pair[DRIVE_SIDES], int16_t limit)
{
    if (larger_magnitude(pair) <= limit)
        return;
    while (larger_magnitude(pair) > INT16_MAX) { // limit * pair must fit 32 bits
        pair[DRIVE_LEFT] /= 2;
        pair[DRIVE_RIGHT] /= 2;
    }
    int32_t largest = larger_magnitude(pair);
    pair[DRIVE_LEFT] = pair[DRIVE_LEFT] * limit / largest;
    pair[DRIVE_RIGHT] = pair[DRIVE_RIGHT] * limit / largest;
}

void drive_init(struct drive *drive, const struct drive_limits *limits)
{
    *drive = (struct drive){.limits = *limits};
}

void drive_command(struct drive *drive, int16_t v_mm_s, int16_t omega_mrad_s)
{
    int32_t forward = (int32_t)v_mm_s * 16;
    int32_t turn = drive->limits.track_um / 25 * omega_mrad_s / 5000; // * 16 / (2 * 1000000)
    int32_t wheels[DRIVE_SIDES] = {forward + turn, forward - turn};
    limit_pair(wheels, drive->limits.speed_q4);
    drive->target_q4[DRIVE_LEFT] = (int16_t)wheels[DRIVE_LEFT];
    drive->target_q4[DRIVE_RIGHT] = (int16_t)wheels[DRIVE_RIGHT];
}

void drive_take_over(struct drive *drive, const int16_t setpoint_q4[DRIVE_SIDES])
{
    for (uint8_t side = 0; side < DRIVE_SIDES; side++)
        drive->target_q4[side] = drive->setpoint_q4[side] = setpoint_q4[side];
}

void drive_release(struct drive *drive)
{
    for (uint8_t side = 0; side < DRIVE_SIDES; side++)
        drive->target_q4[side] = drive->setpoint_q4[side] = 0;
}

void drive_update(struct drive *drive)
{
    int32_t change[DRIVE_SIDES];
    for (uint8_t side = 0; side < DRIVE_SIDES; side++)
        change[side] = (int32_t)drive->target_q4[side] - drive->setpoint_q4[side];
    limit_pair(change, drive->limits.step_q4);
    for (uint8_t side = 0; side < DRIVE_SIDES; side++)
        drive->setpoint_q4[side] = (int16_t)(drive->setpoint_q4[side] + change[side]);
}
