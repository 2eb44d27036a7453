/* Kernel binaries on disk. The file's name is a digest of all that the binary depends on (source,
 * options, device, drivers, our format), and the whole key text stands at the file's head and is
 * compared, so a chance collision or a foreign file is never used. Any failure here means building
 * from source; it is never an error. */
#include "device/internal.h"

#include "base/outfile.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

extern const char *const dmk_kernel_lines[];
extern const size_t dmk_kernel_n_lines;

enum { KEY_SIZE = 2048, MAX_BINARY = 64 << 20 };

static const uint64_t basis = 0xcbf29ce484222325ULL;

/* FNV-1a. */
static uint64_t hash_bytes(uint64_t hash, const char *data, size_t n)
{
    for (size_t i = 0; i < n; i++) hash = (hash ^ (unsigned char)data[i]) * 0x100000001b3ULL;
    return hash;
}

static uint64_t hash_text(uint64_t hash, const char *text)
{
    return hash_bytes(hash, text, strlen(text));
}

static void make_key(const dmk_device *dev, const char *options, char *key)
{
    uint64_t a = basis, b = 0x9e3779b97f4a7c15ULL;
    for (size_t i = 0; i < dmk_kernel_n_lines; i++) {
        a = hash_text(a, dmk_kernel_lines[i]);
        b = hash_text(b ^ i, dmk_kernel_lines[i]);
    }
    char version[256] = "", platform[256] = "";
    clGetDeviceInfo(dev->id, CL_DEVICE_VERSION, sizeof version - 1, version, NULL);
    clGetPlatformInfo(dev->platform, CL_PLATFORM_VERSION, sizeof platform - 1, platform, NULL);
    snprintf(key, KEY_SIZE, "dmkcl-binary-2\n%s\n%s\n%s\n%s\n%s\n%s\n%016llx%016llx\n",
             dev->info.platform, platform, dev->info.name, version, dev->info.driver, options,
             (unsigned long long)a, (unsigned long long)b);
}

static void make_path(const dmk_device *dev, const char *key, char *path, size_t size)
{
    snprintf(path, size, "%s/%016llx%016llx.bin", dev->cache,
             (unsigned long long)hash_text(basis, key),
             (unsigned long long)hash_text(0x84222325cbf29ce4ULL, key));
}

/* mkdir -p */
static int make_folders(char *path)
{
    for (char *p = path + 1; *p; p++) {
        if (*p != '/') continue;
        *p = 0;
        int failed = mkdir(path, 0700) != 0 && errno != EEXIST;
        *p = '/';
        if (failed) return -1;
    }
    return mkdir(path, 0700) != 0 && errno != EEXIST ? -1 : 0;
}

int dmk_cache_folder(dmk_context *ctx, const char *wanted, char *folder, size_t size)
{
    const char *base = getenv("XDG_CACHE_HOME"), *home = getenv("HOME");
    int n;
    if (wanted)
        n = snprintf(folder, size, "%s", wanted);
    else if (base && base[0] == '/')
        n = snprintf(folder, size, "%s/dmkcl", base);
    else if (home && home[0] == '/')
        n = snprintf(folder, size, "%s/.cache/dmkcl", home);
    else
        n = snprintf(folder, size, "%s", "");
    if (n < 0 || (size_t)n + 64 > size) {
        return dmk_fail(ctx, DMK_E_ARG, "the cache folder's name is too long");
    }
    struct stat file;
    if (wanted && stat(wanted, &file) == 0 && !S_ISDIR(file.st_mode))
        return dmk_fail(ctx, DMK_E_ARG, "cache: '%s' is not a folder", wanted);
    return DMK_OK;
}

static char *read_all(const char *path, size_t *size)
{
    FILE *f = fopen(path, "rb");
    if (!f) return NULL;
    char *data = NULL;
    long end;
    if (fseek(f, 0, SEEK_END) == 0 && (end = ftell(f)) > 0 && end <= MAX_BINARY &&
        fseek(f, 0, SEEK_SET) == 0 && (data = malloc((size_t)end)) != NULL) {
        *size = (size_t)end;
        if (fread(data, 1, *size, f) != *size) {
            free(data);
            data = NULL;
        }
    }
    fclose(f);
    return data;
}

int dmk_cache_load(dmk_device *dev, const char *options, cl_program *program)
{
    char key[KEY_SIZE], path[640];
    size_t size = 0;
    if (!dev->cache[0]) return DMK_E_IO;
    make_key(dev, options, key);
    make_path(dev, key, path, sizeof path);
    char *data = read_all(path, &size);
    size_t head = strlen(key) + sizeof(uint64_t);
    int rc = DMK_E_IO;
    uint64_t sum;
    if (data && size > head && memcmp(data, key, strlen(key)) == 0) {
        memcpy(&sum, data + strlen(key), sizeof sum);
        const unsigned char *binary = (unsigned char *)data + head;
        size_t length = size - head;
        cl_int error = CL_INVALID_BINARY, status = CL_INVALID_BINARY;
        cl_program p = hash_bytes(basis, data + head, length) != sum
                           ? NULL
                           : clCreateProgramWithBinary(dev->cl, 1, &dev->id, &length, &binary,
                                                       &status, &error);
        if (p && error == CL_SUCCESS && status == CL_SUCCESS &&
            clBuildProgram(p, 1, &dev->id, options, NULL, NULL) == CL_SUCCESS) {
            *program = p;
            rc = DMK_OK;
        } else if (p) {
            clReleaseProgram(p);
        }
    }
    free(data);
    return rc;
}

/* Others see a whole file or none, and a run that is killed leaves none behind. */
static void write_all(const char *path, const char *key, const char *binary, size_t size)
{
    dmk_outfile file;
    const uint64_t hash = hash_bytes(basis, binary, size);
    if (dmk_outfile_is_stream(path) || dmk_outfile_open(path, &file) != 0) return;
    if (dmk_outfile_append(file.fd, key, strlen(key)) == 0 &&
        dmk_outfile_append(file.fd, &hash, sizeof hash) == 0 &&
        dmk_outfile_append(file.fd, binary, size) == 0)
        dmk_outfile_commit(&file);
    else
        dmk_outfile_discard(&file);
}

/* PoCL wraps the bitcode of a compiled program into a binary from which it can only be linked with all built-in
 * functions anew, 0.3 s. Of the bare bitcode it finds what it linked before. Its length stands before it. */
static char *unwrap(char *binary, size_t *size)
{
    static const char magic[] = "BC\xC0\xDE";
    uint32_t length;
    char *at = memmem(binary, *size, magic, sizeof magic - 1);
    if (!at || (size_t)(at - binary) < sizeof length) return NULL;
    memcpy(&length, at - sizeof length, sizeof length);
    if (length > *size - (size_t)(at - binary)) return NULL;
    *size = length;
    return at;
}

void dmk_cache_store(dmk_device *dev, const char *options, cl_program program)
{
    char key[KEY_SIZE], path[640], folder[512];
    size_t size = 0;
    if (!dev->cache[0]) return;
    snprintf(folder, sizeof folder, "%s", dev->cache);
    if (make_folders(folder) != 0) return;
    if (clGetProgramInfo(program, CL_PROGRAM_BINARY_SIZES, sizeof size, &size, NULL) !=
            CL_SUCCESS ||
        size == 0 || size > MAX_BINARY) {
        return;
    }
    char *binary = malloc(size);
    if (!binary) return;
    if (clGetProgramInfo(program, CL_PROGRAM_BINARIES, sizeof binary, &binary, NULL) ==
        CL_SUCCESS) {
        const char *kept = dev->pocl ? unwrap(binary, &size) : binary;
        make_key(dev, options, key);
        make_path(dev, key, path, sizeof path);
        if (kept) write_all(path, key, kept, size);
    }
    free(binary);
}

/* Where PoCL keeps its kernels, as its manual says; in /tmp, as it does, without a home. */
static void pocl_folder(char *folder, size_t size)
{
    const char *own = getenv("POCL_CACHE_DIR"), *base = getenv("XDG_CACHE_HOME"),
               *home = getenv("HOME");
    if (own && *own)
        snprintf(folder, size, "%s", own);
    else if (base && *base)
        snprintf(folder, size, "%s/pocl/kcache", base);
    else if (home && *home)
        snprintf(folder, size, "%s/.cache/pocl/kcache", home);
    else
        snprintf(folder, size, "/tmp/pocl/kcache");
}

/* Whether a file of so many bytes has room in the folder: 0 or errno. */
static int try_room(const char *folder, off_t bytes)
{
    char name[600];
    snprintf(name, sizeof name, "%s/dmkcl.XXXXXX", folder);
    int fd = open(folder, O_TMPFILE | O_WRONLY | O_CLOEXEC, 0600);
    if (fd < 0) { /* not every file system has files without a name */
        fd = mkstemp(name);
        if (fd >= 0) unlink(name);
    }
    if (fd < 0) return errno;
    struct rlimit limit; /* beyond it comes a signal */
    if (getrlimit(RLIMIT_FSIZE, &limit) == 0 && limit.rlim_cur < (rlim_t)bytes)
        bytes = (off_t)limit.rlim_cur;
    int error =
        bytes == 0 || fallocate(fd, 0, 0, bytes) == 0 || errno == EOPNOTSUPP || errno == ENOSYS
            ? 0
            : errno;
    close(fd);
    return error;
}

int dmk_cache_check_pocl(dmk_context *ctx)
{
    enum { ROOM = 4 << 20 }; /* bytes: all kernels for one device are 1.1 to 1.5 MB */
    char folder[512];
    pocl_folder(folder, sizeof folder);
    int error = make_folders(folder) == 0 ? try_room(folder, ROOM) : errno;
    if (error == 0) return DMK_OK;
    return dmk_fail(ctx, DMK_E_DEVICE,
                    "PoCL cannot keep its kernels in %s: %s; set POCL_CACHE_DIR to a folder that "
                    "can be written to, with %d MB of room",
                    folder, strerror(error), ROOM >> 20);
}
