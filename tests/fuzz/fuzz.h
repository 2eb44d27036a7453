/* Fuzzing drivers: one per subject, for libFuzzer (`make fuzz`) and for replay.c (`make test`). A driver
 * ends the program where a promise is broken. */
#ifndef DMK_FUZZ_H
#define DMK_FUZZ_H

#include <stddef.h>
#include <stdint.h>

/* Try one input; 0. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* What must hold whatever the input. */
#define REQUIRE(claim) ((claim) ? (void)0 : fuzz_broken(#claim, __FILE__, __LINE__))
static inline void fuzz_broken(const char *claim, const char *file, int line)
{
    __builtin_printf("broken promise: %s (%s:%d)\n", claim, file, line);
    __builtin_trap();
}

#endif
