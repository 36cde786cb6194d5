// A move from standstill to standstill: profile, heading hold, braking by the way that is left.
#include "move.h" // this file's manual

#define CREEP_Q4 INT32_C(400)  // slowest of the profile: the last millimetres
#define STILL_TICKS 20       // without travel, and a wheel stands: 0.1 s
#define ROLL_OUT_TICKS 10    // a wheel told to brake rolls on as far as it would go in these
#define LEVEL_DIVISOR 64     // um that a wheel is ahead, per q4 of speed taken off it

static int32_t least(int32_t a, int32_t b)
{
    return a < b ? a : b;
}

static void begin(struct move *move, const struct drive_limits *limits, int32_t left_way_um, int8_t right_sign,
                  int32_t speed_q4, int32_t left_um, int32_t right_um)
{
    int8_t left_sign = left_way_um < 0 ? -1 : 1;
    *move = (struct move){
        .start_um = {left_um, right_um},
        .way_um = left_way_um < 0 ? -left_way_um : left_way_um,
        .cruise_q4 = (int16_t)least(speed_q4, limits->speed_q4),
        .step_q4 = limits->step_q4,
        .sign = {left_sign, (int8_t)(left_sign * right_sign)},
        .last_um = {left_um, right_um},
    };
}

void move_begin_straight(struct move *move, const struct drive_limits *limits, int16_t distance_mm,
                         uint16_t speed_mm_s, int32_t left_um, int32_t right_um)
{
    begin(move, limits, (int32_t)distance_mm * 1000, 1, (int32_t)speed_mm_s * 16, left_um, right_um);
}

void move_begin_turn(struct move *move, const struct drive_limits *limits, int16_t angle_mrad,
                     uint16_t rate_mrad_s, int32_t left_um, int32_t right_um)
{
    int32_t half_um = limits->track_um / 2; // of a radian's arc, mrad by mrad: the whole product exceeds 32 bits
    int32_t way_um = half_um / 1000 * angle_mrad + half_um % 1000 * angle_mrad / 1000;
    uint32_t rate = rate_mrad_s < INT16_MAX ? rate_mrad_s : INT16_MAX;
    int32_t speed_q4 = (int32_t)((uint32_t)limits->track_um / 25 * rate / 5000);
    begin(move, limits, way_um, -1, speed_q4 > 0 ? speed_q4 : 1, left_um, right_um);
}

// The profile's speed this tick with this much way left.
static int16_t next_speed(const struct move *move, int32_t left_um)
{
    int32_t speed = least((int32_t)move->speed_q4 + move->step_q4, move->cruise_q4);
    int32_t room = left_um > 0 ? least(left_um, 400000) : 0;
    while (speed > CREEP_Q4 && speed * speed / 6 > room * move->step_q4)
        speed -= move->step_q4;
    int32_t creep = least(CREEP_Q4, move->cruise_q4);
    return (int16_t)(speed > creep ? speed : creep);
}

bool move_update(struct move *move, int32_t left_um, int32_t right_um, int16_t setpoint_q4[DRIVE_SIDES])
{
    const int32_t at_um[DRIVE_SIDES] = {left_um, right_um};
    int32_t left[DRIVE_SIDES]; // of the way
    for (uint8_t side = 0; side < DRIVE_SIDES; side++)
        left[side] = move->way_um - (at_um[side] - move->start_um[side]) * move->sign[side];

    move->speed_q4 = next_speed(move, (left[DRIVE_LEFT] + left[DRIVE_RIGHT]) / 2);
    int32_t ahead = (left[DRIVE_RIGHT] - left[DRIVE_LEFT]) / LEVEL_DIVISOR;
    int32_t most = move->speed_q4 / 2;
    ahead = ahead > most ? most : ahead < -most ? -most : ahead;

    bool moved = false;
    for (uint8_t side = 0; side < DRIVE_SIDES; side++) {
        if (left[side] <= (int32_t)move->speed_q4 * ROLL_OUT_TICKS * 5 / 16)
            move->arrived[side] = true;
        int32_t speed = side == DRIVE_LEFT ? move->speed_q4 - ahead : move->speed_q4 + ahead;
        setpoint_q4[side] = move->arrived[side] ? 0 : (int16_t)(speed * move->sign[side]);
        moved = moved || at_um[side] != move->last_um[side];
        move->last_um[side] = at_um[side];
    }
    bool both = move->arrived[DRIVE_LEFT] && move->arrived[DRIVE_RIGHT];
    move->still = both && !moved ? (uint8_t)(move->still + 1) : 0;
    return move->still >= STILL_TICKS;
}

void move_pause(struct move *move)
{
    move->speed_q4 = 0;
    move->still = 0;
}
