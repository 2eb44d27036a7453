/* A small fuzzer for any compiler: every file of a corpus, then changed ones.
 * usage: PROGRAM RUNS CORPUS
 * The changes follow from the run's number alone, so that what fails once fails again. The input that
 * breaks the program is left in fuzz-failure. */
#include "fuzz.h"

#include <dirent.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/time.h>
#include <unistd.h>

enum { MAX_FILES = 1024, MAX_SIZE = 8192 };

typedef struct input {
    size_t size;
    uint8_t data[MAX_SIZE];
} input;

static input *corpus[MAX_FILES], now;
static int n_files;

static const char *const words[] = {"0",
                                    "1",
                                    "-1",
                                    "3",
                                    "1e-300",
                                    "1e300",
                                    "nan",
                                    "inf",
                                    "2147483647",
                                    "4294967296",
                                    "-9223372036854775808",
                                    "18446744073709551616",
                                    "0.1",
                                    "1e99999",
                                    "#",
                                    "\n",
                                    "\r\n",
                                    " ",
                                    "\t",
                                    "\\\n",
                                    "/",
                                    "//",
                                    "OFF",
                                    "COFF",
                                    "v ",
                                    "f ",
                                    "vertex ",
                                    "facet",
                                    "loop",
                                    "endloop",
                                    "element vertex ",
                                    "element face ",
                                    "property list uchar int vertex_indices",
                                    "property double x",
                                    "end_header",
                                    "format ascii 1.0",
                                    "format binary_little_endian 1.0",
                                    "$Nodes",
                                    "$EndNodes",
                                    "$Elements",
                                    "<DataArray",
                                    "</DataArray>",
                                    "<Piece",
                                    "NumberOfPoints=\"",
                                    "format=\"appended\"",
                                    "POINTS ",
                                    "POLYGONS ",
                                    "CELLS ",
                                    "CELL_TYPES ",
                                    "DATASET POLYDATA",
                                    "BINARY",
                                    "ASCII"};

static uint64_t state;
static uint32_t below(uint32_t n)
{
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    return (uint32_t)((state >> 33) % n);
}

static void load(const char *folder, const char *name)
{
    char path[1024];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "rb");
    if (!file) exit(2);
    input *in = calloc(1, sizeof *in);
    if (!in) exit(2);
    in->size = fread(in->data, 1, MAX_SIZE, file);
    fclose(file);
    corpus[n_files++] = in;
}

static int skip_hidden(const struct dirent *entry)
{
    return entry->d_name[0] != '.';
}

static void load_all(const char *folder)
{
    struct dirent **entry; /* sorted: the order of a folder is chance */
    int n = scandir(folder, &entry, skip_hidden, alphasort);
    for (int i = 0; i < n; i++) {
        if (n_files < MAX_FILES) load(folder, entry[i]->d_name);
        free(entry[i]);
    }
    if (n <= 0) exit(2);
    free(entry);
}

/* Replace n_old bytes at `at` by n_new others. */
static void replace(size_t at, size_t n_old, const void *with, size_t n_new)
{
    static uint8_t copy[MAX_SIZE];
    if (n_new > MAX_SIZE / 2 || now.size - n_old + n_new > MAX_SIZE) return;
    memcpy(copy, with, n_new);
    memmove(now.data + at + n_new, now.data + at + n_old, now.size - at - n_old);
    memcpy(now.data + at, copy, n_new);
    now.size += n_new - n_old;
}

static void change(void)
{
    static const uint8_t special[] = {0, 1, 0x7f, 0x80, 0xff, '0', '9', '-', ' ', '\n', '#'};
    size_t at = now.size ? below((uint32_t)now.size) : 0, rest = now.size - at;
    size_t n = rest ? 1 + below((uint32_t)(rest < 32 ? rest : 32)) : 0;
    const char *word = words[below(sizeof words / sizeof *words)];
    const input *other = corpus[below((uint32_t)n_files)];
    if (n > rest) n = rest;
    switch (below(8)) {
    case 0:
        if (rest) now.data[at] ^= (uint8_t)(1 << below(8));
        break;
    case 1:
        if (rest) now.data[at] = special[below(sizeof special)];
        break;
    case 2: replace(at, n, "", 0); break;
    case 3: replace(at, 0, now.data + at, n); break;
    case 4: replace(at, below(2) ? n : 0, word, strlen(word)); break;
    case 5:
        if (rest) now.data[at] = (uint8_t)below(256);
        break;
    case 6: now.size = at; break;
    default:
        if (other->size) {
            size_t from = below((uint32_t)other->size), most = other->size - from;
            replace(at, n, other->data + from, 1 + below((uint32_t)(most < 256 ? most : 256)));
        }
    }
}

static void on_failure(int number)
{
    int fd = open("fuzz-failure", O_WRONLY | O_CREAT | O_TRUNC, 0600);
    if (fd >= 0 && write(fd, now.data, now.size) == (ssize_t)now.size) close(fd);
    signal(number, SIG_DFL);
    raise(number);
}

static void watch(void)
{
    static const int signals[] = {SIGABRT, SIGSEGV, SIGILL, SIGTRAP, SIGFPE, SIGBUS, SIGPROF};
    for (size_t i = 0; i < sizeof signals / sizeof *signals; i++) signal(signals[i], on_failure);
}

/* Nothing so small takes 20 seconds of processor time; those of the clock say little on a busy machine. */
static void try_one(void)
{
    const struct itimerval limit = {.it_value.tv_sec = 20};
    setitimer(ITIMER_PROF, &limit, NULL);
    LLVMFuzzerTestOneInput(now.data, now.size);
}

int main(int argc, char **argv)
{
    if (argc != 3) return 2;
    long runs = atol(argv[1]), tried = 0;
    load_all(argv[2]);
    watch();
    for (int i = 0; i < n_files; i++, tried++) {
        now = *corpus[i];
        try_one();
    }
    for (; tried < runs; tried++) {
        state = (uint64_t)tried * 0x9e3779b97f4a7c15ULL;
        now = *corpus[below((uint32_t)n_files)];
        for (uint32_t k = 1 + below(6); k > 0; k--) change();
        try_one();
    }
    for (int i = 0; i < n_files; i++) free(corpus[i]);
    printf("# tried %ld: failed 0\n", tried);
    return 0;
}
