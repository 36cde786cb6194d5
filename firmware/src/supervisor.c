// May the motors run, and why not: one table of transitions, and the inputs that drive it.
#include "supervisor.h" // this file's manual

// Inputs, one bit each. The first group holds for a single update, the second until it changes.
enum {
    SAW_FOREIGN_HELLO = 1 << 0,
    SAW_DRIVE = 1 << 1,
    SAW_STOP = 1 << 2,
    SAW_ESTOP = 1 << 3,
    SAW_CLEAR = 1 << 4,
    DEAD_MAN = 1 << 5,

    IN_SESSION = 1 << 8,
    ESTOP_PRESSED = 1 << 9,
    BATTERY_LOW = 1 << 10,
    WHEELS_STILL = 1 << 11,
};

#define IN(state) (1u << (state))
#define ANYWHERE 0xFFu
#define UNFAULTED (ANYWHERE & ~IN(STATE_FAULT))

struct transition {
    uint8_t from;   // set of states, IN() each
    uint16_t needs; // inputs that must all hold
    uint8_t to;
    uint8_t fault;
};

// The first row that fits is taken, at most one an update. What keeps a fault standing comes before what
// clears it, so CLEAR works only when nothing is wrong any more.
static const struct transition transitions[] = {
    {ANYWHERE, ESTOP_PRESSED, STATE_FAULT, FAULT_ESTOP_BUTTON},
    {ANYWHERE, SAW_ESTOP, STATE_FAULT, FAULT_ESTOP_FRAME},

    {UNFAULTED, BATTERY_LOW, STATE_FAULT, FAULT_BATTERY_LOW},
    {IN(STATE_FAULT), SAW_CLEAR | BATTERY_LOW, STATE_FAULT, FAULT_BATTERY_LOW},
    {IN(STATE_DRIVING), DEAD_MAN, STATE_FAULT, FAULT_LINK_LOST},

    {IN(STATE_FAULT), SAW_CLEAR | IN_SESSION, STATE_READY, FAULT_NONE},
    {IN(STATE_FAULT), SAW_CLEAR, STATE_BOOT, FAULT_NONE},
    {UNFAULTED, SAW_FOREIGN_HELLO, STATE_BOOT, FAULT_NONE},
    {IN(STATE_BOOT), IN_SESSION, STATE_READY, FAULT_NONE},

    {IN(STATE_DRIVING), SAW_STOP, STATE_STOPPED, FAULT_NONE},
    {IN(STATE_READY) | IN(STATE_STOPPED), SAW_DRIVE, STATE_DRIVING, FAULT_NONE},
    {IN(STATE_STOPPED), WHEELS_STILL, STATE_READY, FAULT_NONE},
};

static void update(struct supervisor *supervisor, uint16_t saw)
{
    uint16_t inputs = saw | supervisor->standing;
    for (uint8_t i = 0; i < sizeof transitions / sizeof transitions[0]; i++) {
        const struct transition *row = &transitions[i];
        if ((row->from & IN(supervisor->state)) && (inputs & row->needs) == row->needs) {
            supervisor->state = row->to;
            supervisor->fault = row->fault;
            return;
        }
    }
}

static void set_standing(struct supervisor *supervisor, uint16_t input, bool holds)
{
    if (holds)
        supervisor->standing |= input;
    else
        supervisor->standing &= (uint16_t)~input;
}

void supervisor_init(struct supervisor *supervisor, uint32_t boot_nonce, uint16_t battery_min_mv)
{
    *supervisor = (struct supervisor){
        .state = STATE_BOOT,
        .boot_nonce = boot_nonce,
        .battery_min_mv = battery_min_mv,
    };
}

uint8_t supervisor_hello(struct supervisor *supervisor, uint8_t protocol_version, uint32_t schema_hash)
{
    bool ours = protocol_version == PROTOCOL_VERSION && schema_hash == SCHEMA_HASH;
    set_standing(supervisor, IN_SESSION, ours);
    update(supervisor, ours ? 0 : SAW_FOREIGN_HELLO);
    return ours ? 0 : REFUSED_SCHEMA;
}

uint8_t supervisor_drive(struct supervisor *supervisor, uint32_t now_us, uint32_t expires_us)
{
    if (!(supervisor->standing & IN_SESSION))
        return REFUSED_NO_SESSION;
    if (supervisor->state == STATE_FAULT)
        return REFUSED_FAULT_LATCHED;
    int32_t ahead_us = (int32_t)(expires_us - now_us);
    if (ahead_us <= 0)
        return REFUSED_EXPIRED;
    if (ahead_us > (int32_t)DRIVE_AHEAD_MAX_US)
        return REFUSED_BAD_VALUE;

    update(supervisor, SAW_DRIVE);
    supervisor->drive_us = now_us;
    supervisor->hold_us = (uint32_t)ahead_us < DEAD_MAN_US ? (uint32_t)ahead_us : DEAD_MAN_US;
    supervisor->setpoint_alive = true;
    return 0;
}

void supervisor_stop(struct supervisor *supervisor)
{
    update(supervisor, SAW_STOP);
}

void supervisor_estop(struct supervisor *supervisor)
{
    update(supervisor, SAW_ESTOP);
}

uint8_t supervisor_clear(struct supervisor *supervisor, uint32_t boot_nonce)
{
    if (boot_nonce != supervisor->boot_nonce)
        return REFUSED_BAD_NONCE;
    update(supervisor, SAW_CLEAR);
    return supervisor->state == STATE_FAULT ? REFUSED_FAULT_PERSISTS : 0;
}

// Low only after a while, and low until clearly recovered.
static void watch_battery(struct supervisor *supervisor, uint32_t now_us, uint16_t battery_mv)
{
    uint16_t min_mv = supervisor->battery_min_mv;
    if (battery_mv == 0 || battery_mv >= min_mv + SUPERVISOR_BATTERY_RECOVERY_MV)
        set_standing(supervisor, BATTERY_LOW, false);

    if (battery_mv == 0 || battery_mv >= min_mv) {
        supervisor->battery_sagging = false;
    } else if (!supervisor->battery_sagging) {
        supervisor->battery_sagging = true;
        supervisor->battery_sag_us = now_us;
    } else if (now_us - supervisor->battery_sag_us >= SUPERVISOR_BATTERY_LOW_US) {
        set_standing(supervisor, BATTERY_LOW, true);
    }
}

void supervisor_tick(struct supervisor *supervisor, uint32_t now_us, const struct supervisor_senses *senses)
{
    set_standing(supervisor, ESTOP_PRESSED, senses->estop_pressed);
    set_standing(supervisor, WHEELS_STILL, senses->wheels_still);
    watch_battery(supervisor, now_us, senses->battery_mv);

    uint32_t silence_us = now_us - supervisor->drive_us;
    if (silence_us >= supervisor->hold_us)
        supervisor->setpoint_alive = false;
    update(supervisor, silence_us >= DEAD_MAN_US ? DEAD_MAN : 0);
}
