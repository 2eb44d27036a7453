/* CSV of a cut locus or a path: a line of names, then one row per vertex. */
#include "io/io.h"

static void put_bare(dmk_sink *sink, const dmk_curves *c)
{
    dmk_sink_text(sink, "x,y,z,triangle,w0,w1,w2,distance\n");
    for (size_t v = 0; v < c->n_vertices; v++) {
        const dmk_locus_vertex *x = &c->vertex[v];
        for (int i = 0; i < 3; i++) {
            dmk_sink_number(sink, x->xyz[i]);
            dmk_sink_text(sink, ",");
        }
        dmk_sink_integer(sink, x->place.triangle);
        for (int i = 0; i < 3; i++) {
            dmk_sink_text(sink, ",");
            dmk_sink_number(sink, x->place.weight[i]);
        }
        dmk_sink_text(sink, ",");
        dmk_sink_number(sink, x->distance);
        dmk_sink_text(sink, "\n");
    }
}

int dmk_csv_write_locus(dmk_context *ctx, dmk_sink *sink, const dmk_curves *c)
{
    (void)ctx;
    if (c->bare) {
        put_bare(sink, c);
        return DMK_OK;
    }
    dmk_sink_text(sink, "x,y,z,triangle,w0,w1,w2,distance,mu,strength,angle0,angle1,kind,degree\n");
    for (size_t v = 0; v < c->n_vertices; v++) {
        const dmk_locus_vertex *x = &c->vertex[v];
        const double *w = x->place.weight;
        const double value[11] = {
            x->xyz[0],   x->xyz[1], x->xyz[2],   w[0],        w[1],       w[2],
            x->distance, x->mu,     x->strength, x->angle[0], x->angle[1]};
        for (int i = 0; i < 11; i++) {
            dmk_sink_number(sink, value[i]);
            dmk_sink_text(sink, ",");
            if (i != 2) continue;
            dmk_sink_integer(sink, x->place.triangle);
            dmk_sink_text(sink, ",");
        }
        dmk_sink_integer(sink, x->kind);
        dmk_sink_text(sink, ",");
        dmk_sink_integer(sink, x->degree);
        dmk_sink_text(sink, "\n");
    }
    return DMK_OK;
}
