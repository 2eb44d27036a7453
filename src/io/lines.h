/* Long texts of one record a line, as OFF and OBJ mostly are, read by all threads: the text is cut into chunks
 * at line ends; what stands before a chunk is counted first, so that every line knows its number. Only the
 * plainest lines are taken; what else there is, and all errors, are left to the reader from the beginning. */
#ifndef DMK_LINES_H
#define DMK_LINES_H

#include "io/io.h"

/* Kinds of records, and one for lines that do not count. */
enum { DMK_LINE_KINDS = 2, DMK_LINE_NONE = -1, DMK_LINE_ODD = -2 };

struct dmk_chunks; /* of the text */

typedef struct dmk_lines {
    const dmk_text *text; /* from where it stands on */
    dmk_soup *soup;
    const void *reader; /* of the two functions */
    /* The kind of the line at t, which stands at its first character that is no blank. */
    int (*kind)(const dmk_text *t);
    /* Read record number i of a kind; false: it is not as plain as that. Leaves t in the line. */
    bool (*take)(dmk_text *t, int kind, size_t i, const struct dmk_lines *lines);
    size_t n[DMK_LINE_KINDS]; /* of all records, known in take */
} dmk_lines;

/* Count: *plain if all lines are of a kind. Then `take` may be called for all of them, by dmk_lines_take. */
int dmk_lines_count(dmk_context *context, dmk_lines *lines, struct dmk_chunks **chunks,
                    bool *plain);
int dmk_lines_take(dmk_context *context, const dmk_lines *lines, struct dmk_chunks *chunks,
                   bool *plain);
void dmk_chunks_free(struct dmk_chunks **chunks);

#endif
