/* The terminal: colour, and one line of progress. */
#include "cli.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

/* NO_COLOR counts when it is not empty: see no-color.org. */
static bool has_colour(void)
{
    const char *term = getenv("TERM"), *no = getenv("NO_COLOR");
    return isatty(STDOUT_FILENO) && !(no && *no) && !(term && strcmp(term, "dumb") == 0);
}

const char *cli_bold(void)
{
    return has_colour() ? "\033[1m" : "";
}
const char *cli_plain(void)
{
    return has_colour() ? "\033[0m" : "";
}

/* Seconds until `change` reaches the tolerance; NaN when that cannot be estimated. The change falls
 * exponentially (Newton) or like a power of time (explicit steps): its logarithm is continued with
 * the slope since about half the time ago. */
static double time_left(cli_progress *progress, const dmk_progress *report)
{
    cli_moment *moment = progress->moment;
    const cli_moment now = {report->seconds, log(report->change)};
    if (!(report->change > 0) || !(report->tolerance > 0)) return NAN;
    if (moment[0].seconds <= 0 || now.seconds >= 2 * moment[1].seconds) {
        moment[0] = moment[0].seconds > 0 ? moment[1] : now;
        moment[1] = now;
    }
    const double fallen = moment[0].change - now.change;
    const double to_fall = fmax(0, now.change - log(report->tolerance));
    return fallen > 0 ? to_fall * (now.seconds - moment[0].seconds) / fallen : NAN;
}

enum { LINE_SIZE = 256 };

static void describe(const dmk_progress *report, double gap, double left, FILE *line)
{
    fprintf(line, "%-8s", report->stage);
    if (report->step > 0) fprintf(line, " step %d", report->step);
    if (report->cg_iterations > 0) fprintf(line, "  %d CG", report->cg_iterations);
    if (report->step > 0 && isfinite(report->change))
        fprintf(line, "  change %.1e", report->change);
    if (report->step > 0 && isfinite(gap)) fprintf(line, "  gap %.1e", gap);
    fprintf(line, "  %.1f s", report->seconds);
    if (isfinite(left) && left >= 0.5) fprintf(line, ", about %.0f s left", left);
}

/* One column is left free: a line that fills all of them makes some terminals go to the next. */
static int columns(void)
{
    struct winsize size;
    if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col < 2) return LINE_SIZE;
    return size.ws_col - 1;
}

/* Rewrite the line, cut to the terminal's width: a wrapped one could not be wiped. */
static void show_line(const cli_progress *progress, const dmk_progress *report, double left)
{
    char text[LINE_SIZE] = "";
    FILE *line = fmemopen(text, sizeof text - 1, "w");
    if (!line) return;
    if (progress->prefix) fputs(progress->prefix, line);
    describe(report, progress->gap, left, line);
    fclose(line);
    fprintf(stderr, "\r\033[K%.*s", columns(), text);
    fflush(stderr);
}

/* Of the source before nothing counts. */
static void take_gap(cli_progress *progress, const dmk_progress *report)
{
    if (report->step <= 1) {
        progress->gap = NAN;
        memset(progress->moment, 0, sizeof progress->moment);
    }
    if (isfinite(report->gap)) progress->gap = report->gap;
}

static int on_progress(const dmk_progress *report, void *user)
{
    cli_progress *progress = user;
    if (cli_interrupted()) return 1;
    const bool new_stage = report->stage != progress->stage; /* static strings */
    if (progress->steps) {
        progress->stage = report->stage;
        if (!new_stage && report->step == 0)
            return 0; /* a stage without steps: its start is reported */
        take_gap(progress, report);
        describe(report, progress->gap, NAN, stderr);
        fputc('\n', stderr);
    } else if (progress->line) {
        take_gap(progress, report);
        const double left = time_left(progress, report);
        const double now = cli_seconds();
        if (!new_stage && now - progress->shown < 0.1) return 0; /* the eye sees no more */
        show_line(progress, report, left);
        progress->shown = now;
        progress->stage = report->stage;
        progress->open = true;
    }
    return 0;
}

void cli_watch(dmk_context *context, cli_progress *progress)
{
    dmk_context_set_progress(context, on_progress, progress);
}

void cli_progress_say(cli_progress *progress, const char *text)
{
    if (!progress->line || progress->steps) return;
    fprintf(stderr, "\r\033[K%.*s", columns(), text);
    fflush(stderr);
    progress->open = true;
}

void cli_progress_end(cli_progress *progress)
{
    if (progress->open) fputs("\r\033[K", stderr);
    progress->open = false;
}
