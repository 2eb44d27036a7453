/* Inside the ranks room: lists of whole numbers, and records that ranks send each other while a mesh is dealt out. All
 * that sends is collective. */
#ifndef DMK_POST_H
#define DMK_POST_H

#include "ranks/ranks.h"

/* Whole numbers, of ghosts most often. */
typedef struct dmk_list {
    int64_t *at;
    size_t n, room;
} dmk_list;

int dmk_list_add(dmk_context *context, dmk_list *list, int64_t number);
/* Only what the space does not own. */
int dmk_list_add_ghost(dmk_context *context, dmk_list *list, const dmk_space *space,
                       int64_t number);
/* Of two int64_t, for qsort. */
int dmk_compare_numbers(const void *a, const void *b);
/* In increasing order, each once. */
void dmk_list_sort(dmk_list *list);
/* Where a number stands in a sorted list that has it. */
int32_t dmk_list_place(const dmk_list *list, int64_t number);
/* Sets of a sorted list's numbers, of which pair[2 i] and pair[2 i + 1] are in one, i < n: the places' parents
 * (base/sets.h), made here, and how many sets there are. */
int dmk_list_unite(dmk_context *context, const dmk_list *list, size_t n, const int64_t *pair,
                   int32_t **parent, int64_t *n_sets);
void dmk_list_free(dmk_list *list);

/* Records of `item` bytes to ranks, this one among them; then those that have come, rank after rank, and each one's in
 * the order in which it put them in. */
typedef struct dmk_mail {
    size_t item, n, room, to_room;
    int32_t *to;
    char *data;
    size_t *first; /* ranks + 1: what came from rank r */
} dmk_mail;

/* Room for n records: else it grows. */
int dmk_mail_expect(dmk_context *context, dmk_mail *mail, size_t n);
int dmk_mail_add(dmk_context *context, dmk_mail *mail, int to, const void *record);
/* To each of n ranks once, but not to rank `me`. */
int dmk_mail_add_to(dmk_context *context, dmk_mail *mail, int me, int n, const int *to,
                    const void *record);
int dmk_mail_send(dmk_context *context, const dmk_ranks *ranks, dmk_mail *mail);
/* The same of records that are by rank in mail->data, count[r] for rank r, without dmk_mail_add. */
int dmk_mail_pass(dmk_context *context, const dmk_ranks *ranks, dmk_mail *mail,
                  const int32_t *count);
/* An answer of `item` bytes to each record that has come, and the answers to those that were sent: by rank, and by the
 * order in which they were put in. */
int dmk_mail_answer(dmk_context *context, const dmk_ranks *ranks, const dmk_mail *mail, size_t item,
                    const void *answers, void *came);
void dmk_mail_free(dmk_mail *mail);

/* Numbers that this rank asks of their owners, and those that others ask of it. */
typedef struct dmk_inquiry {
    int32_t *asked, *asks; /* by rank: numbers of its own, and of the ones here */
    dmk_mail mail;         /* the latter, as int64_t */
} dmk_inquiry;
/* n numbers in increasing order. */
int dmk_ask(dmk_context *context, const dmk_ranks *ranks, const int64_t *bound, size_t n,
            const int64_t *number, dmk_inquiry *inquiry);
void dmk_inquiry_free(dmk_inquiry *inquiry);

/* Of n numbers, sorted, each once, the records of `item` bytes that their owners have: of the own ones, which begin at
 * bound[rank], `own` holds them. */
int dmk_fetch(dmk_context *context, const dmk_ranks *ranks, const int64_t *bound, size_t n,
              const int64_t *number, size_t item, const void *own, void *records);
/* The same of compressed rows, own_row[0] = 0; the caller frees *row, n + 1 numbers, and *entries. */
int dmk_fetch_rows(dmk_context *context, const dmk_ranks *ranks, const int64_t *bound, size_t n,
                   const int64_t *number, size_t item, const int32_t *own_row, const void *own,
                   int32_t **row, void **entries);

/* Of one call of dmk_ranks, exchange or begin: out[r] items of `item` bytes to rank r, in[r] from it, rank after
 * rank. Those of this one to itself are copied. */
typedef int dmk_exchange_call(void *user, const void *const *send, const size_t *send_bytes,
                              void *const *receive, const size_t *receive_bytes);
int dmk_exchange_by(dmk_exchange_call *call, dmk_context *context, const dmk_ranks *ranks,
                    const int32_t *out, const int32_t *in, size_t item, const void *send,
                    void *receive);
static inline int dmk_exchange(dmk_context *context, const dmk_ranks *ranks, const int32_t *out,
                               const int32_t *in, size_t item, const void *send, void *receive)
{
    return dmk_exchange_by(ranks->exchange, context, ranks, out, in, item, send, receive);
}
/* A record of `item` bytes of each rank, by rank; made here. */
int dmk_gather_each(dmk_context *context, const dmk_ranks *ranks, size_t item, const void *own,
                    void **all);
/* bound[r + 1] - bound[r] = rank r's n; bound has ranks + 1 numbers. */
int dmk_ranks_bound(dmk_context *context, const dmk_ranks *ranks, int64_t n, int64_t *bound);
/* The rank that owns a number. */
int dmk_owner(const int64_t *bound, int n_ranks, int64_t number);
/* own[bound[rank] ...] of everybody, in one array of bound[size] items, `each` items for a number; made here. */
int dmk_join_all(dmk_context *context, const dmk_ranks *ranks, const int64_t *bound, size_t item,
                 const void *own, void **all);
/* The same of each rank's n items. */
int dmk_join_some(dmk_context *context, const dmk_ranks *ranks, size_t n, size_t item,
                  const void *own, size_t *n_all, void **all);

#endif
