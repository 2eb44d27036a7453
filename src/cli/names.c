/* The names of the files that a batch writes. */
#include "batch.h"

#include <stdlib.h>
#include <string.h>

/* DIR/NAME.vtp; of several sources DIR/NAME-0007.vtp. */
static bool name_file(const batch_request *request, const batch_mesh *mesh, size_t source,
                      const char *kind, const char **path)
{
    const char *suffix = *path;
    char number[32] = "";
    if (request->samples > 0) snprintf(number, sizeof number, "-%04zu", source);
    const size_t room = strlen(request->folder) + strlen(mesh->name) + strlen(suffix) + 64;
    char *name = malloc(room);
    if (name)
        snprintf(name, room, "%s/%s%s%s%s", request->folder, mesh->name, number, kind, suffix);
    *path = name;
    return name != NULL;
}

static bool name_files(const batch_request *request, const batch_mesh *mesh, size_t source,
                       const char *kind, cli_files *files)
{
    bool good = true;
    for (int i = 0; i < files->n; i++) {
        good = name_file(request, mesh, source, kind, &files->path[i]) && good;
    }
    return good;
}

bool batch_name_files(const batch_request *request, const batch_mesh *mesh, size_t source,
                      solve_request *one)
{
    *one = request->each;
    one->mesh = mesh->path;
    one->report = NULL;
    bool good = name_files(request, mesh, source, "", &one->out);
    good = name_files(request, mesh, source, ".locus", &one->locus) && good;
    return name_files(request, mesh, source, ".tangent", &one->tangent) && good;
}

static void free_names(cli_files *files)
{
    for (int i = 0; i < files->n; i++) free((char *)files->path[i]);
    files->n = 0;
}

void batch_free_files(solve_request *one)
{
    free_names(&one->out);
    free_names(&one->locus);
    free_names(&one->tangent);
}
