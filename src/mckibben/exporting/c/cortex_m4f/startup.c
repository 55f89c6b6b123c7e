/* The least that a Cortex-M4F needs before main: vectors, memory, the floating-point unit. */
#include <stdint.h>
#include <stdlib.h>

extern uint32_t data_image[], data_start[], data_end[], bss_start[], bss_end[], stack_top[];
extern void initialise_monitor_handles(void);
extern int main(void);

#define CPACR (*(volatile uint32_t *)0xE000ED88u)

void reset_handler(void);

static void fault(void)
{
    _Exit(70);
}

/* What programs that want these interrupts define. */
__attribute__((weak)) void timer_passed(void);
__attribute__((weak)) void uart_received(void);

__attribute__((section(".vectors"), used)) static void (*const vectors[17])(void) = {
    (void (*)(void))(uintptr_t)stack_top, reset_handler, fault, fault, fault, fault, fault,
    [15] = timer_passed, [16] = uart_received};

void reset_handler(void)
{
    CPACR |= 0xFu << 20; /* full access to the floating-point unit */
    __asm volatile("dsb\nisb");
    for (uint32_t *to = data_start, *from = data_image; to < data_end;) {
        *to++ = *from++;
    }
    for (uint32_t *to = bss_start; to < bss_end;) {
        *to++ = 0;
    }
    initialise_monitor_handles();
    _Exit(main());
}
