/* CSV of a cut locus or a path: a line of names, then one row per vertex. */
#include "io/io.h"

static void put_bare(dmk_output *out, const dmk_curves *c)
{
    dmk_output_text(out, "x,y,z,triangle,w0,w1,w2,distance\n");
    for (size_t v = 0; v < c->n_vertices; v++) {
        const dmk_locus_vertex *x = &c->vertex[v];
        for (int i = 0; i < 3; i++) {
            dmk_output_number(out, x->xyz[i]);
            dmk_output_text(out, ",");
        }
        dmk_output_integer(out, x->place.triangle);
        for (int i = 0; i < 3; i++) {
            dmk_output_text(out, ",");
            dmk_output_number(out, x->place.weight[i]);
        }
        dmk_output_text(out, ",");
        dmk_output_number(out, x->distance);
        dmk_output_text(out, "\n");
    }
}

int dmk_csv_write_locus(dmk_context *ctx, dmk_output *out, const dmk_curves *c)
{
    (void)ctx;
    if (c->bare) {
        put_bare(out, c);
        return DMK_OK;
    }
    dmk_output_text(out, "x,y,z,triangle,w0,w1,w2,distance,mu,strength,angle0,angle1,kind,degree,"
                         "meeting_angle,source_angle\n");
    for (size_t v = 0; v < c->n_vertices; v++) {
        const dmk_locus_vertex *x = &c->vertex[v];
        const double *w = x->place.weight;
        const double value[11] = {x->xyz[0],   x->xyz[1],   x->xyz[2],   w[0],
                                  w[1],        w[2],        x->distance, x->mu,
                                  x->strength, x->angle[0], x->angle[1]};
        for (int i = 0; i < 11; i++) {
            dmk_output_number(out, value[i]);
            dmk_output_text(out, ",");
            if (i != 2) continue;
            dmk_output_integer(out, x->place.triangle);
            dmk_output_text(out, ",");
        }
        dmk_output_integer(out, x->kind);
        dmk_output_text(out, ",");
        dmk_output_integer(out, x->degree);
        dmk_output_text(out, ",");
        dmk_output_number(out, x->meeting_angle);
        dmk_output_text(out, ",");
        dmk_output_number(out, x->source_angle);
        dmk_output_text(out, "\n");
    }
    return DMK_OK;
}
