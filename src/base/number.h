/* Numbers as text, in the "C" locale whatever the program's locale is. */
#ifndef DMK_NUMBER_H
#define DMK_NUMBER_H

#include "base/base.h"

#include <locale.h>

/* Holds the "C" locale for the rare slow cases; one per reader or writer, so that no global is
 * needed. */
typedef struct dmk_numbers {
    locale_t c;
} dmk_numbers;

int dmk_numbers_create(dmk_context *context, dmk_numbers *numbers);
void dmk_numbers_free(dmk_numbers *numbers);

/* Read a decimal number (no hexadecimal, no inf, no nan) that starts exactly at *at, rounded to the
 * nearest double; *at moves behind it. False, with *at unchanged, if there is none. There must be a
 * readable character that cannot belong to a number at `end` or before. */
bool dmk_number_read(const dmk_numbers *numbers, const char **at, const char *end, double *value);

/* The same for an integer; false also when its size is more than INT64_MAX. */
bool dmk_integer_read(const char **at, const char *end, int64_t *value);

/* Print the shortest of %.15g, %.16g, %.17g that reads back as the same double.
 * Gives its length. */
#define DMK_NUMBER_TEXT 32
int dmk_number_print(const dmk_numbers *numbers, double value, char text[DMK_NUMBER_TEXT]);

#endif
