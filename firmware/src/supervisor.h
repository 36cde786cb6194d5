// May the motors run, and why not: states, faults, dead-man and e-stop.
//
//   BOOT     since reset no host has shown that it speaks this schema; only HELLO leads out
//   READY    standing; DRIVE leads out
//   DRIVING  the only state in which motors may run, and only while the setpoint is alive
//   STOPPED  braking after STOP; becomes READY when the wheels stand, or DRIVING by a new DRIVE
//   FAULT    latched; only CLEAR with this start's nonce leads out, and only once the cause is gone
//
// The dead-man needs no switching on: DRIVING ends in FAULT_LINK_LOST when DEAD_MAN_US pass without a DRIVE
// being obeyed. A DRIVE may ask for less: its setpoint dies at its deadline, motors off, but the fault still
// waits for the dead-man, so that one late frame does not end a session. An e-stop is honoured in any state
// and replaces another fault; otherwise the first cause is kept until CLEAR.
//
// All transitions are one table in supervisor.c, first match wins. Times are the robot's clock in
// microseconds; it may wrap. Refusals are enum refusal of messages.h, 0 meaning obeyed.
#ifndef SUPERVISOR_H
#define SUPERVISOR_H

#include <stdbool.h> // bool
#include <stdint.h>  // integers of known width

#include "messages.h" // enum state, enum fault, enum refusal, DEAD_MAN_US

#define SUPERVISOR_BATTERY_LOW_US UINT32_C(500000) // low for this long is no sag from a starting motor
#define SUPERVISOR_BATTERY_RECOVERY_MV 200u        // above the minimum before CLEAR is obeyed

struct supervisor {
    uint8_t state; // enum state
    uint8_t fault; // enum fault; FAULT_NONE outside STATE_FAULT

    uint32_t boot_nonce;
    uint16_t battery_min_mv;
    uint16_t standing;       // inputs that hold until they change, a set of bits private to supervisor.c
    uint32_t drive_us;       // when the last DRIVE was obeyed
    uint32_t hold_us;        // how long after that its setpoint lives
    bool setpoint_alive;     // its deadline has not passed
    bool battery_sagging;    // below minimum, but perhaps not for long
    uint32_t battery_sag_us; // since when
};

// What the supervisor is told every tick.
struct supervisor_senses {
    uint16_t battery_mv; // 0: not measured, and then never called low
    bool estop_pressed;  // the button, now
    bool wheels_still;   // neither encoder sees motion
};

// Everything off. boot_nonce: another number after every start. battery_min_mv: 0 for no watch on it.
void supervisor_init(struct supervisor *supervisor, uint32_t boot_nonce, uint16_t battery_min_mv);

// A host names its schema. One that differs ends any session: its later frames might mean something else.
uint8_t supervisor_hello(struct supervisor *supervisor, uint8_t protocol_version, uint32_t schema_hash);

// A setpoint that dies at expires_us. If obeyed, motors may run until then, or the dead-man if that is first.
uint8_t supervisor_drive(struct supervisor *supervisor, uint32_t now_us, uint32_t expires_us);

void supervisor_stop(struct supervisor *supervisor);

void supervisor_estop(struct supervisor *supervisor);

uint8_t supervisor_clear(struct supervisor *supervisor, uint32_t boot_nonce);

// Every tick: time passes, senses change.
void supervisor_tick(struct supervisor *supervisor, uint32_t now_us, const struct supervisor_senses *senses);

// The one question every motor output asks first.
static inline bool supervisor_may_run(const struct supervisor *supervisor)
{
    return supervisor->state == STATE_DRIVING && supervisor->setpoint_alive;
}

#endif
