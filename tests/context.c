#include "context.h"

#include <dmkcl.h>

int context_setup(void **state)
{
    dmk_context *ctx;
    if (dmk_context_create(&ctx) != DMK_OK) return -1;
    *state = ctx;
    return 0;
}

int context_teardown(void **state)
{
    dmk_context *ctx = *state;
    dmk_context_destroy(&ctx);
    return 0;
}
