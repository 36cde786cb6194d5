// Timer 1 and the driver's pins: a signed duty becomes direction and PWM.
#include "motors.h" // this file's manual

#include <avr/io.h> // timer 1, ports B and D

#include "../drive.h" // DRIVE_LEFT, DRIVE_RIGHT
#include "../hal.h"   // what is answered here
#include "../motor.h" // MOTOR_DUTY_FULL
#include "pins.h"     // where the driver is wired

// Counting up and down (mode 8), so that 0 and PWM_TOP are truly off and on, without a spike.
#define PWM_HZ 20000ul
#define PWM_TOP ((uint16_t)(F_CPU / (2 * PWM_HZ)))

#define TIMER1_MODE_A (1u << COM1A1 | 1u << COM1B1)
#define TIMER1_MODE_B (1u << WGM13 | 1u << CS10)

#define DRIVER_PORT_B (PIN_LEFT_IN2 | PIN_LEFT_PWM | PIN_RIGHT_PWM)
#define DRIVER_PORT_D (PIN_LEFT_IN1 | PIN_RIGHT_IN1 | PIN_RIGHT_IN2 | PIN_STANDBY)

void motors_safe(void)
{
    PORTB &= (uint8_t)~DRIVER_PORT_B;
    PORTD &= (uint8_t)~DRIVER_PORT_D;
    DDRB |= DRIVER_PORT_B;
    DDRD |= DRIVER_PORT_D;
}

void motors_init(void)
{
    ICR1 = PWM_TOP;
    OCR1A = 0;
    OCR1B = 0;
    TCCR1A = TIMER1_MODE_A;
    TCCR1B = TIMER1_MODE_B;
    hal_motor_set(0, DRIVE_LEFT, 0);
    hal_motor_set(0, DRIVE_RIGHT, 0);
    PORTD |= PIN_STANDBY;
}

bool motors_intact(void)
{
    return TCCR1A == TIMER1_MODE_A && TCCR1B == TIMER1_MODE_B && ICR1 == PWM_TOP;
}

static uint16_t compare_of(int16_t duty)
{
    uint16_t size = duty < 0 ? (uint16_t)-duty : (uint16_t)duty;
    return (uint16_t)(((uint32_t)size * PWM_TOP + MOTOR_DUTY_FULL / 2) / MOTOR_DUTY_FULL);
}

// Both direction pins are high while they change: between one direction and the other the motor is shorted,
// never open.
void hal_motor_set(struct hal *hal, uint8_t side, int16_t duty)
{
    (void)hal;
    uint16_t compare = compare_of(duty);
    if (side == DRIVE_LEFT) {
        PORTD |= PIN_LEFT_IN1;
        PORTB |= PIN_LEFT_IN2;
        OCR1A = compare;
        if (duty > 0)
            PORTB &= (uint8_t)~PIN_LEFT_IN2;
        else if (duty < 0)
            PORTD &= (uint8_t)~PIN_LEFT_IN1;
    } else {
        PORTD |= PIN_RIGHT_IN1 | PIN_RIGHT_IN2;
        OCR1B = compare;
        if (duty > 0)
            PORTD &= (uint8_t)~PIN_RIGHT_IN2;
        else if (duty < 0)
            PORTD &= (uint8_t)~PIN_RIGHT_IN1;
    }
}

// Both direction pins low opens the motor's ends; the driver promises that only while the PWM is high. Should
// a duty follow, the motor is shorted first, as always.
void hal_motor_coast(struct hal *hal, uint8_t side)
{
    (void)hal;
    if (side == DRIVE_LEFT) {
        PORTD &= (uint8_t)~PIN_LEFT_IN1;
        PORTB &= (uint8_t)~PIN_LEFT_IN2;
        OCR1A = PWM_TOP;
    } else {
        PORTD &= (uint8_t)~(PIN_RIGHT_IN1 | PIN_RIGHT_IN2);
        OCR1B = PWM_TOP;
    }
}
