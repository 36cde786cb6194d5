// The encoder interrupt, in assembly: robot_encoder_edge() for whichever wheel's pins changed.
//
// It is the one interrupt with a deadline of its own: two edges of one wheel within its time are read as one
// illegal transition. As C this compiler makes it 108 cycles for one wheel and 142 for both, entry and return
// counted; this is 87 and 114. encoder_edge() stays what it must do: tests/firmware/avr puts both through the
// same edges.
#include <stddef.h> // offsetof

#include <avr/interrupt.h> // ISR
#include <avr/io.h>        // PINC, TCNT0, TIFR0

#include "../robot.h" // struct robot
#include "clock.h"    // clock_overflows
#include "pins.h"     // which bits are whose

extern struct robot robot; // main.c's

_Static_assert(PIN_LEFT_SHIFT == 0 && PIN_RIGHT_SHIFT == 2, "written out below");

// One wheel, r30 holding its pins in the low two bits. r26, r27: stamp. Uses r30, r31. See encoder_edge().
#define WHEEL(name)                                                       \
    "    andi r30, 3                                                 \n" \
    "    mov  r31, r30                                               \n" \
    "    lsr  r31                                                    \n" \
    "    eor  r30, r31            ; the new phase                    \n" \
    "    lds  r31, %[" name "]+%[phase]                              \n" \
    "    sts  %[" name "]+%[phase], r30                              \n" \
    "    sub  r30, r31                                               \n" \
    "    andi r30, 3              ; steps 1 forward, 3 backward      \n" \
    "    breq 9f                                                     \n" \
    "    ldi  r31, 2                                                 \n" \
    "    sub  r31, r30            ; +1 forward, -1 backward          \n" \
    "    breq 8f                                                     \n" \
    "    sts  %[" name "]+%[direction], r31                          \n" \
    "    lds  r30, %[" name "]+%[count]                              \n" \
    "    add  r30, r31                                               \n" \
    "    sts  %[" name "]+%[count], r30                              \n" \
    "    sts  %[" name "]+%[stamp], r26                              \n" \
    "    sts  %[" name "]+%[stamp]+1, r27                            \n" \
    "    rjmp 9f                                                     \n" \
    "8:  lds  r30, %[" name "]+%[illegal]                            \n" \
    "    inc  r30                                                    \n" \
    "    sts  %[" name "]+%[illegal], r30                            \n" \
    "9:                                                              \n"

ISR(PCINT1_vect, ISR_NAKED)
{
    __asm__ volatile(
        "    push r24                                                \n"
        "    in   r24, %[sreg]                                       \n"
        "    push r24                                                \n"
        "    push r25                                                \n"
        "    push r26                                                \n"
        "    push r27                                                \n"
        "    push r30                                                \n"
        "    push r31                                                \n"

        "    in   r26, %[tcnt0]       ; clock_stamp()                \n"
        "    lds  r27, %[overflows]                                  \n"
        "    sbis %[tifr0], %[tov0]                                  \n"
        "    rjmp 1f                                                 \n"
        "    sbrs r26, 7                                             \n"
        "    inc  r27                                                \n"

        "1:  in   r25, %[pinc]                                       \n"
        "    in   r24, %[seen]        ; the pins last time           \n"
        "    out  %[seen], r25                                       \n"
        "    eor  r24, r25            ; those that changed           \n"

        "    mov  r30, r24                                           \n"
        "    andi r30, %[left_pins]                                  \n"
        "    breq 9f                                                 \n"
        "    mov  r30, r25                                           \n"
        WHEEL("left")

        "    andi r24, %[right_pins]                                 \n"
        "    breq 9f                                                 \n"
        "    mov  r30, r25                                           \n"
        "    lsr  r30                                                \n"
        "    lsr  r30                                                \n"
        WHEEL("right")

        "    pop  r31                                                \n"
        "    pop  r30                                                \n"
        "    pop  r27                                                \n"
        "    pop  r26                                                \n"
        "    pop  r25                                                \n"
        "    pop  r24                                                \n"
        "    out  %[sreg], r24                                       \n"
        "    pop  r24                                                \n"
        "    reti                                                    \n"
        :
        : [sreg] "I"(_SFR_IO_ADDR(SREG)), [tcnt0] "I"(_SFR_IO_ADDR(TCNT0)), [tifr0] "I"(_SFR_IO_ADDR(TIFR0)),
          [tov0] "I"(TOV0), [pinc] "I"(_SFR_IO_ADDR(PINC)), [seen] "I"(_SFR_IO_ADDR(GPIOR0)),
          [overflows] "i"(&clock_overflows), [left_pins] "M"(PIN_LEFT_ENCODER),
          [right_pins] "M"(PIN_RIGHT_ENCODER), [left] "i"(&robot.edges[DRIVE_LEFT]),
          [right] "i"(&robot.edges[DRIVE_RIGHT]), [phase] "i"(offsetof(struct encoder_edges, phase)),
          [count] "i"(offsetof(struct encoder_edges, count)),
          [direction] "i"(offsetof(struct encoder_edges, direction)),
          [illegal] "i"(offsetof(struct encoder_edges, illegal)),
          [stamp] "i"(offsetof(struct encoder_edges, stamp))
        : "memory");
}
