/* The file of sources that `solve --sources` takes. */
#include "fuzz.h"

#include "cli/solve.h"

#include <math.h>
#include <stdlib.h>
#include <unistd.h>

static char path[] = "/dev/shm/dmkcl-fuzz-sources-XXXXXX";
static int fd = -1;

static void remove_file(void)
{
    unlink(path);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    solve_source *source = NULL;
    size_t n = 0;
    if (fd < 0) {
        fd = mkstemp(path);
        REQUIRE(fd >= 0);
        atexit(remove_file);
    }
    REQUIRE(pwrite(fd, data, size, 0) == (ssize_t)size && ftruncate(fd, (off_t)size) == 0);
    int code = solve_read_sources(path, &source, &n);
    REQUIRE(code == EXIT_OK || code == 3);
    REQUIRE((code == EXIT_OK) == (source != NULL && n > 0));
    for (size_t i = 0; code == EXIT_OK && i < n; i++) {
        const double *x = source[i].xyz;
        REQUIRE(source[i].line > 0 && (i == 0 || source[i].line > source[i - 1].line));
        REQUIRE(source[i].vertex >= -1);
        REQUIRE(source[i].vertex >= 0 || (isfinite(x[0]) && isfinite(x[1]) && isfinite(x[2])));
    }
    free(source);
    return 0;
}
