/* Numbers of files that come as text or as binary data. */
#ifndef DMK_VALUES_H
#define DMK_VALUES_H

#include "io/io.h"

typedef enum dmk_type {
    DMK_INT8,
    DMK_UINT8,
    DMK_INT16,
    DMK_UINT16,
    DMK_INT32,
    DMK_UINT32,
    DMK_INT64,
    DMK_UINT64,
    DMK_FLOAT32,
    DMK_FLOAT64
} dmk_type;

size_t dmk_type_bytes(dmk_type type);
bool dmk_type_is_float(dmk_type type);
/* Whether this machine puts the low byte of a number first. */
bool dmk_is_little_endian(void);
/* The number at p, whose bytes stand the other way round if `swap`. */
double dmk_decode_number(dmk_type type, const char *p, bool swap);
/* The same as an integer: of a float its integral part, and -1 for what does not fit 63 bits. */
int64_t dmk_decode_integer(dmk_type type, const char *p, bool swap);

/* A position in a file whose numbers are words of text, or binary. */
typedef struct dmk_values {
    dmk_text text;
    bool binary, swap;
} dmk_values;

/* Fail with DMK_E_FORMAT and "path:line: " in text, "path: byte N: " in binary data. */
int dmk_values_fail(const dmk_values *values, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
/* The next number; `what` names it in errors. Of text that is declared to be in single precision the
 * nearest single is taken: that is what its writer had. */
int dmk_values_number(dmk_values *values, dmk_type type, const char *what, double *value);
int dmk_values_integer(dmk_values *values, dmk_type type, const char *what, int64_t *value);
/* A whole number in 0 .. limit-1. */
int dmk_values_index(dmk_values *values, dmk_type type, const char *what, size_t limit,
                     int64_t *value);
int dmk_values_skip(dmk_values *values, dmk_type type, size_t n);
/* Fail if `count` of `what`, of `numbers` numbers of at least the size of `type` each, cannot fit
 * into the rest of the file. To be asked before room is made for them. */
int dmk_values_room(const dmk_values *values, const char *what, int64_t count, size_t numbers,
                    dmk_type type);

#endif
