// Timers 0 and 2: what time it is, and when the next tick is due.
#include "clock.h" // this file's manual

#include <avr/interrupt.h> // ISR
#include <avr/io.h>        // timers 0 and 2
#include <util/atomic.h>   // ATOMIC_BLOCK

#include "../robot.h" // ROBOT_TICK_US

#define TIMER2_PRESCALER 64u
#define TIMER2_US 1000u
#define TICK_PERIODS (ROBOT_TICK_US / TIMER2_US)

_Static_assert(F_CPU / 64u * ENCODER_STAMP_US == 1000000u, "timer 0 at clock/64 counts encoder stamps");
_Static_assert(ROBOT_TICK_US % TIMER2_US == 0, "a tick is a whole number of timer 2's periods");
_Static_assert(F_CPU / TIMER2_PRESCALER * TIMER2_US % 1000000u == 0, "timer 2 keeps exact time");

volatile uint32_t clock_overflows;
static volatile bool tick_due;

ISR(TIMER0_OVF_vect)
{
    clock_overflows++;
}

ISR(TIMER2_COMPA_vect)
{
    static uint8_t periods_left = TICK_PERIODS;
    if (--periods_left == 0) {
        periods_left = TICK_PERIODS;
        tick_due = true;
    }
}

void clock_init(void)
{
    TCCR0A = 0;
    TCCR0B = 1u << CS01 | 1u << CS00;
    TIMSK0 = 1u << TOIE0;

    TCCR2A = 1u << WGM21;
    OCR2A = (uint8_t)(F_CPU / TIMER2_PRESCALER * TIMER2_US / 1000000u - 1u);
    TCCR2B = 1u << CS22;
    TIMSK2 = 1u << OCIE2A;
}

uint32_t clock_us(void)
{
    uint32_t overflows;
    uint8_t low;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        overflows = clock_overflows;
        low = TCNT0;
        if ((TIFR0 & (1u << TOV0)) && !(low & 0x80))
            overflows++;
    }
    return (overflows << 8 | low) * ENCODER_STAMP_US;
}

bool clock_tick_due(void)
{
    return tick_due;
}

bool clock_take_tick(void)
{
    bool due = tick_due;
    if (due)
        tick_due = false; // one byte: an interrupt in between only sets what is set
    return due;
}
