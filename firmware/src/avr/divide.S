; Division of 32-bit numbers, in place of the compiler's own, which takes 600 cycles whatever the numbers are.
;
; The control loop divides twenty times a tick, mostly by powers of two, which this compiler, told to save flash,
; does not turn into shifts where numbers have a sign. Here a power of two takes about 50 cycles, and others as many
; steps as the numbers have bytes: about 150 to 400. Signed division is the compiler's own, around this.
;
; r22..r25 / r18..r21: quotient to r18..r21, remainder to r22..r25. Uses r26, r27, r30, r31. Keeps r0 and the T flag,
; in which signed division has the signs. By zero: no particular result, but an end.

#define NUMBER_0 r22
#define NUMBER_1 r23
#define NUMBER_2 r24
#define NUMBER_3 r25
#define BY_0 r18
#define BY_1 r19
#define BY_2 r20
#define BY_3 r21
#define ZERO r1

    .section .text.divide, "ax", @progbits
    .global __udivmodsi4
    .type __udivmodsi4, @function
__udivmodsi4:
    movw r26, BY_0              ; r26, r27, r30, r31: the divisor less one
    movw r30, BY_2
    sbiw r26, 1
    sbc  r30, ZERO
    sbc  r31, ZERO
    mov  ZERO, r26              ; has it a bit in common with the divisor? r1 is lent until the end
    and  ZERO, BY_0
    brne no_power
    mov  ZERO, r27
    and  ZERO, BY_1
    brne no_power
    mov  ZERO, r30
    and  ZERO, BY_2
    brne no_power
    mov  ZERO, r31
    and  ZERO, BY_3
    brne no_power

; By a power of two: what is below it remains, the rest is shifted, once for every bit of the divisor less one.
    movw BY_0, NUMBER_0
    movw BY_2, NUMBER_2
    and  NUMBER_0, r26
    and  NUMBER_1, r27
    and  NUMBER_2, r30
    and  NUMBER_3, r31
bytes:
    cpi  r26, 0xFF
    brne bits
    mov  BY_0, BY_1
    mov  BY_1, BY_2
    mov  BY_2, BY_3
    clr  BY_3
    mov  r26, r27
    mov  r27, r30
    mov  r30, r31
    clr  r31
    rjmp bytes
bits:
    lsr  r26
    brcc shifted
    lsr  BY_3
    ror  BY_2
    ror  BY_1
    ror  BY_0
    rjmp bits
shifted:
    ret                         ; the last of the ands has left r1 zero

no_power:
    clr  r26
    clr  r27
    mov  ZERO, BY_2
    or   ZERO, BY_3
    breq short

; By 65536 or more: the upper half of the number begins as remainder, the quotient has 16 bits.
    ldi  r30, 16
long_step:
    lsl  NUMBER_0
    rol  NUMBER_1
    rol  NUMBER_2
    rol  NUMBER_3
    rol  r26
    rol  r27
    cp   NUMBER_2, BY_0
    cpc  NUMBER_3, BY_1
    cpc  r26, BY_2
    cpc  r27, BY_3
    brcs long_next
    sub  NUMBER_2, BY_0
    sbc  NUMBER_3, BY_1
    sbc  r26, BY_2
    sbc  r27, BY_3
    inc  NUMBER_0
long_next:
    dec  r30
    brne long_step
    clr  ZERO
    movw BY_0, NUMBER_0
    clr  BY_2
    clr  BY_3
    movw NUMBER_0, NUMBER_2
    movw NUMBER_2, r26
    ret

; By less: the number's bytes one after another, from the top, each becoming a byte of the quotient; the remainder
; is r26, r27. Bytes that are zero are passed over, as is the first if the divisor has two bytes.
short:
    ldi  r30, 4                 ; bytes
short_skip:
    tst  NUMBER_3
    brne short_begin
    rcall turn
    dec  r30
    brne short_skip
    rjmp short_end
short_begin:
    tst  BY_1
    breq short_byte
    mov  r26, NUMBER_3
    clr  NUMBER_3
    rcall turn
    dec  r30
    breq short_end
short_byte:
    ldi  r31, 8
short_step:
    lsl  NUMBER_3
    rol  r26
    rol  r27
    brcs short_subtract
    cp   r26, BY_0
    cpc  r27, BY_1
    brcs short_next
short_subtract:
    sub  r26, BY_0
    sbc  r27, BY_1
    inc  NUMBER_3
short_next:
    dec  r31
    brne short_step
    rcall turn
    dec  r30
    brne short_byte
short_end:
    clr  ZERO
    movw BY_0, NUMBER_0
    movw BY_2, NUMBER_2
    movw NUMBER_0, r26
    clr  NUMBER_2
    clr  NUMBER_3
    ret

; The next byte of the number to the top, the topmost to the bottom.
turn:
    mov  ZERO, NUMBER_3
    mov  NUMBER_3, NUMBER_2
    mov  NUMBER_2, NUMBER_1
    mov  NUMBER_1, NUMBER_0
    mov  NUMBER_0, ZERO
    ret

    .size __udivmodsi4, . - __udivmodsi4
