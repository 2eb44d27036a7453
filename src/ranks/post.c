/* Records from rank to rank; see post.h. */
#include "ranks/post.h"

#include "base/sets.h"

#include <stdlib.h>
#include <string.h>

/* ---- lists of numbers ------------------------------------------------------------------------- */

int dmk_list_add(dmk_context *ctx, dmk_list *list, int64_t number)
{
    int rc = DMK_OK;
    if (list->n > 0 && list->at[list->n - 1] == number) return DMK_OK;
    DMK_TRY(DMK_GROW(ctx, list->at, list->n + 1, list->room));
    list->at[list->n++] = number;
done:
    return rc;
}

int dmk_list_add_ghost(dmk_context *ctx, dmk_list *list, const dmk_space *s, int64_t number)
{
    return dmk_space_owns(s, number) ? DMK_OK : dmk_list_add(ctx, list, number);
}

int dmk_compare_numbers(const void *a, const void *b)
{
    const int64_t *x = a, *y = b;
    return (*x > *y) - (*x < *y);
}

void dmk_list_sort(dmk_list *list)
{
    size_t n = 0;
    if (list->n > 0) qsort(list->at, list->n, sizeof *list->at, dmk_compare_numbers);
    for (size_t i = 0; i < list->n; i++) {
        if (n == 0 || list->at[n - 1] != list->at[i]) list->at[n++] = list->at[i];
    }
    list->n = n;
}

int32_t dmk_list_place(const dmk_list *list, int64_t number)
{
    return (int32_t)dmk_count_below(list->at, list->n, number);
}

int dmk_list_unite(dmk_context *ctx, const dmk_list *list, size_t n, const int64_t *pair,
                   int32_t **parent, int64_t *n_sets)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, *parent, list->n));
    for (size_t i = 0; i < list->n; i++) (*parent)[i] = (int32_t)i;
    *n_sets = (int64_t)list->n;
    for (size_t i = 0; i < n; i++)
        *n_sets -= dmk_set_unite(*parent, dmk_list_place(list, pair[2 * i]),
                                 dmk_list_place(list, pair[2 * i + 1]));
done:
    return rc;
}

void dmk_list_free(dmk_list *list)
{
    free(list->at);
    *list = (dmk_list){0};
}

/* ---- exchanges -------------------------------------------------------------------------------- */

int dmk_exchange_by(dmk_exchange_call *call, dmk_context *ctx, const dmk_ranks *ranks,
                    const int32_t *out, const int32_t *in, size_t item, const void *send,
                    void *receive)
{
    int rc;
    const size_t size = (size_t)ranks->size, me = (size_t)ranks->rank;
    size_t at_send = 0, at_receive = 0;
    const void **sends = NULL;
    void **receives = NULL;
    size_t *bytes = NULL;
    DMK_TRY(DMK_NEW(ctx, sends, size));
    DMK_TRY(DMK_NEW(ctx, receives, size));
    DMK_TRY(DMK_NEW(ctx, bytes, 2 * size));
    for (size_t r = 0; r < size; r++) {
        sends[r] = (const char *)send + at_send;
        receives[r] = (char *)receive + at_receive;
        at_send += bytes[r] = item * (size_t)out[r];
        at_receive += bytes[size + r] = item * (size_t)in[r];
    }
    if (bytes[me] > 0) memcpy(receives[me], sends[me], bytes[me]);
    bytes[me] = bytes[size + me] = 0;
    rc = dmk_ranks_check(ctx, ranks, call(ranks->user, sends, bytes, receives, bytes + size));
done:
    free(sends);
    free(receives);
    free(bytes);
    return rc;
}

/* What each of the others has for this rank, from what this one has for each. Nobody sends to itself. */
static int swap_counts(dmk_context *ctx, const dmk_ranks *ranks, const int32_t *out, int32_t *in)
{
    int rc;
    const int me = ranks->rank;
    int32_t *one = NULL, *sent = NULL;
    DMK_TRY(DMK_NEW(ctx, one, (size_t)ranks->size));
    DMK_TRY(DMK_NEW(ctx, sent, (size_t)ranks->size));
    for (int r = 0, k = 0; r < ranks->size; r++) {
        one[r] = r != me;
        if (r != me) sent[k++] = out[r];
    }
    DMK_TRY(dmk_exchange(ctx, ranks, one, one, sizeof *out, sent, in));
    memmove(in + me + 1, in + me, (size_t)(ranks->size - 1 - me) * sizeof *in);
    in[me] = out[me];
done:
    free(one);
    free(sent);
    return rc;
}

int dmk_gather_each(dmk_context *ctx, const dmk_ranks *ranks, size_t item, const void *own,
                    void **all)
{
    int rc;
    size_t *bytes = NULL;
    DMK_TRY(DMK_NEW(ctx, bytes, (size_t)ranks->size));
    for (int r = 0; r < ranks->size; r++) bytes[r] = item;
    DMK_TRY(dmk_alloc(ctx, "records of all ranks", (size_t)ranks->size, item, all));
    rc = dmk_ranks_check(ctx, ranks, ranks->gather(ranks->user, own, *all, bytes));
done:
    free(bytes);
    return rc;
}

int dmk_ranks_bound(dmk_context *ctx, const dmk_ranks *ranks, int64_t n, int64_t *bound)
{
    int rc;
    int64_t *all = NULL;
    DMK_TRY(dmk_gather_each(ctx, ranks, sizeof n, &n, (void **)&all));
    bound[0] = 0;
    for (int r = 0; r < ranks->size; r++) bound[r + 1] = bound[r] + all[r];
done:
    free(all);
    return rc;
}

int dmk_owner(const int64_t *bound, int n_ranks, int64_t number)
{
    int low = 0, high = n_ranks;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (bound[middle] <= number)
            low = middle;
        else
            high = middle;
    }
    return low;
}

int dmk_join_all(dmk_context *ctx, const dmk_ranks *ranks, const int64_t *bound, size_t item,
                 const void *own, void **all)
{
    int rc;
    size_t *bytes = NULL;
    DMK_TRY(DMK_NEW(ctx, bytes, (size_t)ranks->size));
    for (int r = 0; r < ranks->size; r++) bytes[r] = item * (size_t)(bound[r + 1] - bound[r]);
    DMK_TRY(dmk_alloc(ctx, "items of all ranks", (size_t)bound[ranks->size], item, all));
    rc = dmk_ranks_check(ctx, ranks, ranks->gather(ranks->user, own, *all, bytes));
done:
    free(bytes);
    return rc;
}

int dmk_join_some(dmk_context *ctx, const dmk_ranks *ranks, size_t n, size_t item, const void *own,
                  size_t *n_all, void **all)
{
    int rc;
    int64_t *bound = NULL;
    DMK_TRY(DMK_NEW(ctx, bound, (size_t)ranks->size + 1));
    DMK_TRY(dmk_ranks_bound(ctx, ranks, (int64_t)n, bound));
    *n_all = (size_t)bound[ranks->size];
    rc = dmk_join_all(ctx, ranks, bound, item, own, all);
done:
    free(bound);
    return rc;
}

/* ---- mail ------------------------------------------------------------------------------------- */

int dmk_mail_expect(dmk_context *ctx, dmk_mail *m, size_t n)
{
    int rc;
    DMK_TRY(DMK_GROW(ctx, m->to, n + 1, m->to_room));
    rc = dmk_grow(ctx, "mail", n + 1, m->item, &m->room, (void **)&m->data);
done:
    return rc;
}

int dmk_mail_add(dmk_context *ctx, dmk_mail *m, int to, const void *record)
{
    if (m->n >= m->to_room || m->n >= m->room) {
        const int rc = dmk_mail_expect(ctx, m, m->n);
        if (rc != DMK_OK) return rc;
    }
    m->to[m->n] = to;
    memcpy(m->data + m->item * m->n++, record, m->item);
    return DMK_OK;
}

int dmk_mail_add_to(dmk_context *ctx, dmk_mail *m, int me, int n, const int *to, const void *record)
{
    int rc = DMK_OK;
    for (int k = 0; k < n; k++) {
        bool has_it = to[k] == me;
        for (int i = 0; i < k; i++) has_it = has_it || to[i] == to[k];
        if (!has_it) DMK_TRY(dmk_mail_add(ctx, m, to[k], record));
    }
done:
    return rc;
}

/* Whether they are by rank already; *count: how many for each. */
static bool is_sorted(const dmk_mail *m, int32_t *count)
{
    bool sorted = true;
    for (size_t i = 0; i < m->n; i++) {
        count[m->to[i]]++;
        sorted = sorted && (i == 0 || m->to[i - 1] <= m->to[i]);
    }
    return sorted;
}

/* By rank, each one's in the order that they had. */
static int sort_mail(dmk_context *ctx, const dmk_ranks *ranks, dmk_mail *m, int32_t *count)
{
    int rc;
    size_t *fill = NULL;
    char *sorted = NULL;
    DMK_TRY(dmk_mail_expect(ctx, m, m->n)); /* there may be none at all */
    if (is_sorted(m, count)) return DMK_OK;
    DMK_TRY(DMK_NEW(ctx, fill, (size_t)ranks->size + 1));
    DMK_TRY(dmk_alloc(ctx, "mail", m->n, m->item, (void **)&sorted));
    for (int r = 0; r < ranks->size; r++) fill[r + 1] = fill[r] + (size_t)count[r];
    for (size_t i = 0; i < m->n; i++)
        memcpy(sorted + m->item * fill[m->to[i]]++, m->data + m->item * i, m->item);
    free(m->data);
    m->data = sorted;
done:
    free(fill);
    return rc;
}

int dmk_mail_pass(dmk_context *ctx, const dmk_ranks *ranks, dmk_mail *m, const int32_t *count)
{
    int rc;
    int32_t *in = NULL;
    char *came = NULL;
    DMK_TRY(DMK_NEW(ctx, in, (size_t)ranks->size));
    DMK_TRY(DMK_NEW(ctx, m->first, (size_t)ranks->size + 1));
    DMK_TRY(swap_counts(ctx, ranks, count, in));
    for (int r = 0; r < ranks->size; r++) m->first[r + 1] = m->first[r] + (size_t)in[r];
    m->n = m->first[ranks->size];
    DMK_TRY(dmk_alloc(ctx, "mail", m->n, m->item, (void **)&came));
    DMK_TRY(dmk_exchange(ctx, ranks, count, in, m->item, m->data, came));
    free(m->data);
    m->data = came;
    came = NULL;
done:
    free(in);
    free(came);
    return rc;
}

int dmk_mail_send(dmk_context *ctx, const dmk_ranks *ranks, dmk_mail *m)
{
    int rc;
    int32_t *count = NULL;
    DMK_TRY(DMK_NEW(ctx, count, (size_t)ranks->size));
    DMK_TRY(sort_mail(ctx, ranks, m, count));
    free(m->to);
    m->to = NULL;
    rc = dmk_mail_pass(ctx, ranks, m, count);
done:
    free(count);
    return rc;
}

void dmk_mail_free(dmk_mail *m)
{
    free(m->to);
    free(m->data);
    free(m->first);
    *m = (dmk_mail){.item = m->item};
}

/* ---- what owners have ------------------------------------------------------------------------- */

void dmk_inquiry_free(dmk_inquiry *q)
{
    free(q->asked);
    free(q->asks);
    dmk_mail_free(&q->mail);
}

int dmk_ask(dmk_context *ctx, const dmk_ranks *ranks, const int64_t *bound, size_t n,
            const int64_t *number, dmk_inquiry *q)
{
    int rc;
    q->mail.item = sizeof *number;
    DMK_TRY(DMK_NEW(ctx, q->asked, (size_t)ranks->size));
    DMK_TRY(DMK_NEW(ctx, q->asks, (size_t)ranks->size));
    for (size_t i = 0; i < n; i++) {
        const int owner = dmk_owner(bound, ranks->size, number[i]);
        q->asked[owner]++;
        DMK_TRY(dmk_mail_add(ctx, &q->mail, owner, &number[i]));
    }
    DMK_TRY(dmk_mail_send(ctx, ranks, &q->mail));
    for (int r = 0; r < ranks->size; r++)
        q->asks[r] = (int32_t)(q->mail.first[r + 1] - q->mail.first[r]);
done:
    return rc;
}

int dmk_mail_answer(dmk_context *ctx, const dmk_ranks *ranks, const dmk_mail *mail, size_t item,
                    const void *answers, void *came)
{
    int rc;
    int32_t *out = NULL, *in = NULL;
    DMK_TRY(DMK_NEW(ctx, out, (size_t)ranks->size));
    DMK_TRY(DMK_NEW(ctx, in, (size_t)ranks->size));
    for (int r = 0; r < ranks->size; r++) out[r] = (int32_t)(mail->first[r + 1] - mail->first[r]);
    DMK_TRY(swap_counts(ctx, ranks, out, in));
    rc = dmk_exchange(ctx, ranks, out, in, item, answers, came);
done:
    free(out);
    free(in);
    return rc;
}

/* Own numbers that were asked for: where they stand among the own ones. */
static size_t asked_at(const dmk_inquiry *q, int64_t first, size_t i)
{
    return (size_t)(((const int64_t *)(const void *)q->mail.data)[i] - first);
}

/* What `own` has, from number `first` on, of those that were asked for. */
static int answer(dmk_context *ctx, const dmk_ranks *ranks, int64_t first, const dmk_inquiry *q,
                  size_t item, const void *own, void *records)
{
    int rc;
    char *answers = NULL;
    DMK_TRY(dmk_alloc(ctx, "records", q->mail.n, item, (void **)&answers));
    for (size_t i = 0; i < q->mail.n; i++)
        memcpy(answers + item * i, (const char *)own + item * asked_at(q, first, i), item);
    rc = dmk_exchange(ctx, ranks, q->asks, q->asked, item, answers, records);
done:
    free(answers);
    return rc;
}

int dmk_fetch(dmk_context *ctx, const dmk_ranks *ranks, const int64_t *bound, size_t n,
              const int64_t *number, size_t item, const void *own, void *records)
{
    int rc;
    dmk_inquiry q = {0};
    DMK_TRY(dmk_ask(ctx, ranks, bound, n, number, &q));
    rc = answer(ctx, ranks, bound[ranks->rank], &q, item, own, records);
done:
    dmk_inquiry_free(&q);
    return rc;
}

/* Entries for each rank, from those of each number. */
static void count_entries(const dmk_ranks *ranks, const int32_t *numbers, const int32_t *length,
                          int32_t *entries)
{
    for (int r = 0; r < ranks->size; r++) {
        entries[r] = 0;
        for (int32_t k = 0; k < numbers[r]; k++) entries[r] += *length++;
    }
}

static int answer_rows(dmk_context *ctx, const dmk_ranks *ranks, int64_t first,
                       const dmk_inquiry *q, size_t item, const int32_t *own_row, const char *own,
                       const int32_t *length, char *entries)
{
    int rc;
    size_t at = 0;
    int32_t *mine = NULL, *count = NULL;
    char *answers = NULL;
    DMK_TRY(DMK_NEW(ctx, mine, q->mail.n));
    DMK_TRY(DMK_NEW(ctx, count, 2 * (size_t)ranks->size));
    for (size_t i = 0; i < q->mail.n; i++) {
        const size_t k = asked_at(q, first, i);
        at += (size_t)(mine[i] = own_row[k + 1] - own_row[k]);
    }
    const size_t n = at;
    DMK_TRY(dmk_alloc(ctx, "rows", n, item, (void **)&answers));
    at = 0;
    for (size_t i = 0; i < q->mail.n; i++) {
        const size_t from = (size_t)own_row[asked_at(q, first, i)];
        memcpy(answers + item * at, own + item * from, item * (size_t)mine[i]);
        at += (size_t)mine[i];
    }
    count_entries(ranks, q->asks, mine, count);
    count_entries(ranks, q->asked, length, count + ranks->size);
    rc = dmk_exchange(ctx, ranks, count, count + ranks->size, item, answers, entries);
done:
    free(mine);
    free(count);
    free(answers);
    return rc;
}

int dmk_fetch_rows(dmk_context *ctx, const dmk_ranks *ranks, const int64_t *bound, size_t n,
                   const int64_t *number, size_t item, const int32_t *own_row, const void *own,
                   int32_t **row, void **entries)
{
    int rc;
    const int64_t first = bound[ranks->rank], n_own = bound[ranks->rank + 1] - first;
    dmk_inquiry q = {0};
    int32_t *length = NULL;
    DMK_TRY(DMK_NEW(ctx, length, (size_t)n_own));
    DMK_TRY(DMK_NEW(ctx, *row, n + 1));
    for (int64_t i = 0; i < n_own; i++) length[i] = own_row[i + 1] - own_row[i];
    DMK_TRY(dmk_ask(ctx, ranks, bound, n, number, &q));
    DMK_TRY(answer(ctx, ranks, first, &q, sizeof *length, length, *row + 1));
    free(length);
    length = NULL;
    DMK_TRY(DMK_NEW(ctx, length, n));
    memcpy(length, *row + 1, n * sizeof *length);
    for (size_t i = 0; i < n; i++) (*row)[i + 1] += (*row)[i];
    DMK_TRY(dmk_alloc(ctx, "rows", (size_t)(*row)[n], item, entries));
    rc = answer_rows(ctx, ranks, first, &q, item, own_row, own, length, *entries);
done:
    dmk_inquiry_free(&q);
    free(length);
    return rc;
}
