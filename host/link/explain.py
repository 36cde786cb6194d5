"""What the robot means, in plain words: what happened, why, and what to do about it."""

from __future__ import annotations

from host.link.protocol import Fault, Refusal, ResetCause

FAULTS: dict[Fault, str] = {
    Fault.NONE: "no fault",
    Fault.LINK_LOST: "the robot heard no command for 0.2 s and braked: check the cable, then clear the fault",
    Fault.ESTOP_FRAME: "an emergency stop was sent: see that the way is free, then clear the fault",
    Fault.ESTOP_BUTTON: "the emergency stop button was pressed: release it, then clear the fault",
    Fault.STALL: "the motors push, no wheel turns: free the robot, check motor wires, then clear the fault",
    Fault.ENCODER_DEAD: "a wheel is driven and its encoder silent: check its wires, then clear the fault",
    Fault.ENCODER_REVERSED: (
        "a wheel turns against its motor: swap the encoder's A and B or the motor's two wires, "
        "or left and right, then clear the fault"
    ),
    Fault.RUNAWAY: (
        "a wheel turns faster than told: check motor driver and encoder wires, then clear the fault"
    ),
    Fault.BATTERY_LOW: "the battery is empty: charge it, then clear the fault",
    Fault.OVERRUN: "the robot's program was late: clear the fault; if it comes again, report it",
    Fault.WATCHDOG: "the robot's program hung and restarted: clear the fault; if it comes again, report it",
}

REFUSALS: dict[Refusal, str] = {
    Refusal.NONE: "no reason",
    Refusal.NO_SESSION: "the robot knows of no session: connect again",
    Refusal.SCHEMA: "the robot has another schema: flash the firmware that belongs to this program",
    Refusal.EXPIRED: "it reached the robot too late: the line is slow or the computer busy; try again",
    Refusal.BAD_VALUE: "a number is out of the robot's range: docs/protocol.md has the ranges",
    Refusal.FAULT_LATCHED: "a fault is latched: clear it first",
    Refusal.BAD_NONCE: "it was meant for the robot before it restarted: connect again",
    Refusal.FAULT_PERSISTS: "the fault's cause is still there: remove it, then clear again",
    Refusal.NOT_STANDING: "the robot does not stand ready: stop it and wait until its wheels rest",
    Refusal.BUSY: "the robot is still busy with the request before: wait for its outcome, or send STOP",
    Refusal.OLD_REQUEST: "a later request was sent since, perhaps by another program: end that one",
    Refusal.BY_STOP: "it was stopped",
    Refusal.BY_DRIVE: "a velocity command ended it",
    Refusal.BY_FAULT: "the robot stopped itself",
    Refusal.NOT_STORED: "the EEPROM does not hold what was written to it: save again; it may be worn out",
}

RESETS: dict[ResetCause, str] = {
    ResetCause.UNKNOWN: "for no known reason",
    ResetCause.POWER_ON: "its power came back",
    ResetCause.EXTERNAL: "by its button, or because its port was opened",
    ResetCause.BROWN_OUT: "its voltage broke down: check the battery",
    ResetCause.WATCHDOG: "its program hung",
}
