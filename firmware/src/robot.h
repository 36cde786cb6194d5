// The whole firmware above the hardware: what happens at start, every tick, every byte and every edge.
//
// One struct robot holds all state, so several robots can live in one program. Of these calls only
// robot_encoder_edge() may come from an interrupt; the others belong to the main loop. now_us is the robot's
// clock, 0 at start; it may wrap but never goes back.
#ifndef ROBOT_H
#define ROBOT_H

#include <stdint.h> // integers of known width

#include "drive.h"      // wheel setpoints
#include "encoder.h"    // counts and speeds
#include "hal.h"        // struct hal
#include "link.h"       // frames
#include "motor.h"      // wheel control
#include "move.h"       // moves of known length
#include "params.h"     // what differs between robots
#include "requests.h"   // exactly once
#include "supervisor.h" // permission
#include "watch.h"      // are the wheels what they should be

#define ROBOT_TICK_US 5000u // 200 Hz

struct robot {
    struct hal *hal;
    struct encoder_edges edges[DRIVE_SIDES]; // written by interrupts
    struct encoder encoders[DRIVE_SIDES];
    struct motor motors[DRIVE_SIDES];
    struct drive drive;
    struct move move; // while MOVING
    struct watch watch;
    struct supervisor supervisor;
    struct params params;
    struct requests requests;
    struct link link;
    uint16_t battery_mv;    // at the last tick
    uint32_t byte_us;       // when the byte now being handled came
    uint8_t drive_seq;      // sequence number of the last DRIVE obeyed
    uint8_t telemetry_in;   // ticks until the next TELEMETRY
    uint8_t link_status_in; // ticks until the next LINK_STATUS
};

// Motors off, counters zero, encoders as their pins are, parameters as the EEPROM has them; HELLO is sent.
// Encoder interrupts come after this.
void robot_init(struct robot *robot, struct hal *hal);

// An encoder pin may have changed. stamp: the robot's clock in ENCODER_STAMP_US, low 16 bits.
static inline void robot_encoder_edge(struct robot *robot, uint8_t side, uint8_t pins, uint16_t stamp)
{
    encoder_edge(&robot->edges[side], pins, stamp);
}

// One byte from the line. A message it completes takes effect before this returns: ESTOP has then zeroed the
// motors.
void robot_receive_byte(struct robot *robot, uint8_t byte, uint32_t now_us);

// The three parts of a tick, for a processor on which a byte that completes an ESTOP must not wait for all of them:
// it may handle bytes in between. Sense; decide and drive, with a time not before that of any byte; then report, with
// the time of sensing.
void robot_sense(struct robot *robot, uint32_t now_us);
void robot_control(struct robot *robot, uint32_t now_us);
void robot_report(struct robot *robot, uint32_t now_us);

// Every ROBOT_TICK_US: all three at once.
void robot_tick(struct robot *robot, uint32_t now_us);

#endif
