// The ATmega328P: start, main loop, and when the watchdog is fed.
#include <avr/interrupt.h> // sei, cli
#include <avr/io.h>        // pin-change registers
#include <avr/sleep.h>     // idle sleep

#include "../robot.h" // the firmware
#include "clock.h"    // time and ticks
#include "motors.h"   // set-up and check
#include "pins.h"     // where the encoders are
#include "reset.h"    // watchdog
#include "senses.h"   // set-up
#include "serial.h"   // received bytes

// Received bytes handled in one round, so that babble on the line cannot keep ticks from coming. The line
// brings at most 125 bytes a tick and rounds come one after another, so none is lost to this.
#define BYTES_PER_ROUND 32u

struct robot robot; // the encoder interrupt writes its `edges`

// The stack grows down towards the end of the variables; what stands there must stay.
extern uint8_t _end; // NOLINT(bugprone-reserved-identifier,cert-*): the linker's name
#define STACK_GUARD 0xA5u

uint8_t hal_interrupts_off(struct hal *hal)
{
    (void)hal;
    uint8_t before = SREG;
    cli();
    return before;
}

void hal_interrupts_restore(struct hal *hal, uint8_t before)
{
    (void)hal;
    __asm__ volatile("" ::: "memory"); // nothing moves out of the section past this
    SREG = before;
}

static void start(void)
{
    clock_init();
    serial_init();
    senses_init();
    motors_init();
    DDRB |= PIN_LED;

    PCMSK1 = PIN_LEFT_ENCODER | PIN_RIGHT_ENCODER;
    PCIFR = 1u << PCIF1; // pull-ups coming up are no edges
    hal_uart_put(0, 0); // ends the frame that a reset may have cut, lest HELLO be taken for its rest
    robot_init(&robot, 0);
    PCICR = 1u << PCIE1; // an edge since the pins were read is still pending

    *(volatile uint8_t *)&_end = STACK_GUARD;
    sleep_enable(); // idle, as reset chose: timers and line go on
    watchdog_start();
    sei();
}

// Sleep unless there is work. An interrupt between looking and sleeping cannot be missed: the instruction
// after sei() runs before any interrupt does.
static void sleep_until_work(void)
{
    cli();
    if (!serial_waiting() && !clock_tick_due()) {
        sei();
        sleep_cpu();
    }
    sei();
}

static bool all_is_well(void)
{
    return *(volatile uint8_t *)&_end == STACK_GUARD && motors_intact();
}

static void show_fault(void)
{
    if (robot.supervisor.state == STATE_FAULT)
        PORTB |= PIN_LED;
    else
        PORTB &= (uint8_t)~PIN_LED;
}

static void receive_round(void)
{
    for (uint8_t budget = BYTES_PER_ROUND; budget > 0 && serial_waiting(); budget--)
        robot_receive_byte(&robot, serial_take(), clock_us());
}

static void tick(void)
{
    uint32_t now_us = clock_us();
    robot_sense(&robot, now_us);
    receive_round(); // an ESTOP may be waiting, and each part takes some tenths of a millisecond
    robot_control(&robot, clock_us());
    receive_round();
    robot_report(&robot, now_us);
    show_fault();
}

int main(void)
{
    start();
    for (;;) {
        sleep_until_work();
        receive_round();
        if (clock_take_tick()) {
            tick();
            if (all_is_well())
                watchdog_feed(); // here alone: bytes were handled, the tick ran, and the checks hold
        }
    }
}
