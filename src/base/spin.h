/* Waiting for other threads where that takes microseconds. */
#ifndef DMK_SPIN_H
#define DMK_SPIN_H

#include <sched.h>

/* Between two looks at what is waited for; *looks: 0 at first. Now and then others may have the processor. */
static inline void dmk_spin(int *looks)
{
    enum { SPINS = 2000 }; /* speed only */
    if (++*looks == SPINS) {
        *looks = 0;
        sched_yield();
        return;
    }
#if defined(__x86_64__) || defined(__i386__)
    __builtin_ia32_pause();
#endif
}

#endif
