/* Digests of files and options. */
#include "cli.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

static void digest_word(cli_digest *d, uint64_t word)
{
    d->a = (d->a ^ word) * 0x9e3779b97f4a7c15ULL;
    d->a ^= d->a >> 29;
    d->b = (d->b + word) * 0xd6e8feb86659fd93ULL;
    d->b ^= d->b >> 32;
}

void cli_digest_add(cli_digest *d, const char *bytes, size_t n)
{
    uint64_t word;
    for (; n >= sizeof word; n -= sizeof word, bytes += sizeof word) {
        memcpy(&word, bytes, sizeof word);
        digest_word(d, word);
    }
    word = n + 1; /* so that zeros at the end count */
    memcpy((char *)&word + 1, bytes, n);
    digest_word(d, word);
}

void cli_digest_print(const cli_digest *d, char hex[CLI_DIGEST_SIZE])
{
    snprintf(hex, CLI_DIGEST_SIZE, "%016" PRIx64 "%016" PRIx64, d->a, d->b);
}

bool cli_digest_file(const char *path, char hex[CLI_DIGEST_SIZE])
{
    enum { PIECE = 1 << 18 };
    cli_digest d = {0};
    hex[0] = '\0';
    FILE *file = cli_is_file(path) ? fopen(path, "rb") : NULL;
    char *piece = malloc(PIECE);
    bool good = file && piece;
    for (size_t n = PIECE; good && n == PIECE;) {
        n = fread(piece, 1, PIECE, file);
        cli_digest_add(&d, piece, n);
        good = !ferror(file);
    }
    free(piece);
    if (file) fclose(file);
    if (good) cli_digest_print(&d, hex);
    return good;
}
