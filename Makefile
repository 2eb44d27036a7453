# dmkcl. `make help` lists the targets and variables. Needs GNU make; builds without git.

MAKEFLAGS += --no-builtin-rules

CONFIG ?= release
prefix ?= /usr/local
PREFIX ?= $(prefix)
DESTDIR ?=
# The processor to build for, as gcc's -march: `native` is for this machine only.
ARCH ?= native
CC = gcc
V ?=
# WERROR=1: warnings are errors. Not by default: later compilers and libraries warn of more.
WERROR ?=

bindir ?= $(PREFIX)/bin
libdir ?= $(PREFIX)/lib
includedir ?= $(PREFIX)/include
mandir ?= $(PREFIX)/share/man
completionsdir ?= $(PREFIX)/share/bash-completion/completions

# A blank would make two names of one, and `uninstall` would delete what the first of them names.
FOLDERS := DESTDIR PREFIX bindir libdir includedir mandir completionsdir
$(foreach f,$(FOLDERS),$(if $(filter 1,$(words x$($f)x)),,$(error $f='$($f)': expected a folder without blanks)))
# Programs are to find it from anywhere, and behind DESTDIR it begins with /.
$(foreach f,$(filter-out DESTDIR,$(FOLDERS)),$(if $(filter-out /%,$($f)),\
    $(error $f='$($f)': expected a whole path, from / on)))

B := build/$(CONFIG)
# V=1 shows the commands instead of one word each.
Q := $(if $(V),,@)
say = $(if $(V),,@printf '  %-7s %s\n' $(1) $(2))

VERSION := $(shell awk '/define DMK_VERSION_(MAJOR|MINOR|PATCH)/ { printf "%s%s", s, $$3; s = "." }' \
    include/dmkcl.h)
# Until 1.0 a new minor version may change structs: the soname has two numbers.
SONAME := libdmkcl.so.$(basename $(VERSION))

# ---- flags -----------------------------------------------------------------------------------

MARCH := $(if $(ARCH),-march=$(ARCH))
OPT_release := -O3 $(MARCH) -fno-math-errno
OPT_debug := -O0 -g
OPT_sanitize := -O1 -g -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer
OPT_thread := -O1 -g -fsanitize=thread -fno-omit-frame-pointer
OPT_coverage := -O0 -g --coverage -include tests/coverage.h
# For tests/fuzz; with clang.
OPT_fuzz := -O1 -g -fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=all \
    -fno-omit-frame-pointer
ifeq ($(OPT_$(CONFIG)),)
$(error CONFIG=$(CONFIG): expected release, debug, sanitize, thread, coverage or fuzz)
endif

WARN := -Wall -Wextra -Wpedantic -Wshadow -Wstrict-prototypes -Wmissing-prototypes -Wpointer-arith \
    -Wvla $(if $(WERROR),-Werror)
CFLAGS ?=
LDFLAGS ?=
# No semantic interposition: calls inside the shared library are then as cheap as in the static one.
FLAGS := -std=c11 -D_GNU_SOURCE -DCL_TARGET_OPENCL_VERSION=120 $(WARN) $(OPT_$(CONFIG)) -fPIC \
    -fno-semantic-interposition -Iinclude -Isrc -Ikernels $(CFLAGS)
LINK := $(OPT_$(CONFIG)) $(LDFLAGS)
LDLIBS := -lOpenCL -lhwloc -lz -lexpat -lpthread -lm

# ---- files -----------------------------------------------------------------------------------

# Each knows the rooms before it only: tests/test_layers.sh.
ROOMS := base mesh surfaces levels geodesic io device ranks solver locus cut api
LIB_SRC := $(sort $(foreach room,$(ROOMS),$(wildcard src/$(room)/*.c)))
CLI_SRC := $(filter-out src/cli/life.c,$(sort $(wildcard src/cli/*.c))) # life.c: only with MPI
# One program source, in this order: what a file uses stands before it.
KERNELS := $(addprefix kernels/,dmk_shared.h base.cl operator.cl vector.cl multigrid.cl density.cl \
    nested.cl certificate.cl ranks.cl)
TEST_SRC := $(sort $(wildcard tests/test_*.c))
# What tests share: any other C file beside them.
TEST_LIB_SRC := $(filter-out $(TEST_SRC),$(sort $(wildcard tests/*.c)))
TEST_SCRIPTS := $(sort $(wildcard tests/test_*.sh))

LIB_OBJ := $(LIB_SRC:%.c=$B/%.o) $B/kernels.o
CLI_OBJ := $(CLI_SRC:%.c=$B/%.o)
TEST_OBJ := $(TEST_SRC:%.c=$B/%.o)
TEST_LIB_OBJ := $(TEST_LIB_SRC:%.c=$B/%.o)
TESTS := $(TEST_SRC:%.c=$B/%)
STATIC := $B/libdmkcl.a
SHARED := $B/libdmkcl.so.$(VERSION)
TOOL := $B/dmkcl
PC := $B/dmkcl.pc
MAN := $B/dmkcl.1
MAN3 := $B/dmkcl.3

.PHONY: all tests test coverage pyenv paper demo bench bench-kernels bench-anderson bench-methods bench-ranks docs install uninstall dist clean help deps FORCE
.SECONDARY:
.DELETE_ON_ERROR:

all: $(STATIC) $(SHARED) $(TOOL) $(TESTS)
tests: $(TESTS)

# ---- what the build stands on ----------------------------------------------------------------

# Looked at once for each list. What is named here installs; the other targets say what is missing.
INSTALLING := deps demo docs paper test ci coverage fuzz faults real check-%
# What these need is less than what the tests do, which look at browsers and other programs.
BUILDING := demo docs install uninstall dist
PACKAGE_LIST := .ci/$(if $(filter-out $(BUILDING),$(or $(MAKECMDGOALS),all)),packages,build-packages)
PACKAGES := build/$(notdir $(PACKAGE_LIST)).ok
deps: $(PACKAGES)
$(PACKAGES): $(PACKAGE_LIST) .ci/deps.sh
	@mkdir -p $(@D)
	@sh .ci/deps.sh $(if $(filter $(INSTALLING),$(MAKECMDGOALS)),install,check) $<
	@touch $@

# Changes only when the compiler or its flags do, and then everything is built anew.
$B/flags: FORCE
	@mkdir -p $(@D)
	@echo '$(CC) $(FLAGS) $(LINK) $(LDLIBS)' | cmp -s - $@ || echo '$(CC) $(FLAGS) $(LINK) $(LDLIBS)' > $@

# Changes only when a source comes or goes: of one that has gone nothing is left in what is built.
$B/objects: FORCE
	@mkdir -p $(@D)
	@echo '$(LIB_OBJ) $(CLI_OBJ)' | cmp -s - $@ || echo '$(LIB_OBJ) $(CLI_OBJ)' > $@

# ---- library and tool ------------------------------------------------------------------------

$B/%.o: %.c $B/flags | $(PACKAGES)
	@mkdir -p $(@D)
	$(call say,CC,$<)
	$(Q)$(CC) $(FLAGS) -MMD -MP -c $< -o $@

$B/kernels.c: $(KERNELS) kernels/embed.sh
	@mkdir -p $(@D)
	$(call say,EMBED,$@)
	$(Q)sh kernels/embed.sh $(KERNELS) > $@.tmp && mv $@.tmp $@
$B/kernels.o: $B/kernels.c $B/flags | $(PACKAGES)
	$(call say,CC,$<)
	$(Q)$(CC) $(FLAGS) -c $< -o $@

$(STATIC): $(LIB_OBJ) $B/objects
	$(call say,AR,$@)
	$(Q)rm -f $@ && $(AR) rcs $@ $(LIB_OBJ)

# The shared library exports the functions that the public header declares, and nothing else.
$B/exports.map: include/dmkcl.h
	@mkdir -p $(@D)
	$(Q)sed -e 's,/\*.*\*/,,' -e '/^ \*/d' $< | grep -o 'dmk_[a-z0-9_]*(' | sort -u | \
	    awk 'BEGIN { print "{ global:" } { sub(/\(/, ";"); print "  " $$0 } END { print "local: *; };" }' > $@
$(SHARED): $(LIB_OBJ) $B/exports.map $B/objects
	$(call say,LD,$@)
	$(Q)$(CC) -shared $(LINK) -Wl,-soname,$(SONAME) -Wl,-Bsymbolic-functions \
	    -Wl,--version-script=$B/exports.map $(LIB_OBJ) -o $@ $(LDLIBS)
	$(Q)ln -sf $(@F) $B/$(SONAME) && ln -sf $(@F) $B/libdmkcl.so

$B/dmkcl: $(CLI_OBJ) $(STATIC) $B/objects
	$(call say,LD,$@)
	$(Q)$(CC) $(LINK) $(CLI_OBJ) $(STATIC) -o $@ $(LDLIBS)

# With MPI=1 the tool once more, as what mpirun starts: only its own files are built anew, against MPI.
MPI ?=
MPI_B := build/mpi$(if $(filter-out release,$(CONFIG)),-$(CONFIG))
MPI_OBJ := $(CLI_SRC:%.c=$(MPI_B)/%.o) $(MPI_B)/src/cli/life.o
MPI_PACKAGES := build/mpi-packages.ok
MPI_LIBS = $$(pkg-config --libs ompi-c 2> /dev/null || mpicc -showme:link)
ifneq ($(MPI),)
all: $(MPI_B)/dmkcl
endif
$(MPI_PACKAGES): .ci/mpi-packages .ci/deps.sh
	@mkdir -p $(@D)
	@sh .ci/deps.sh install $<
	@touch $@
$(MPI_B)/%.o: %.c $B/flags | $(PACKAGES) $(MPI_PACKAGES)
	@mkdir -p $(@D)
	$(call say,MPICC,$<)
	$(Q)$(CC) $(FLAGS) -DDMK_MPI $$(pkg-config --cflags ompi-c 2> /dev/null || mpicc -showme:compile) -MMD -MP -c $< -o $@
$(MPI_B)/dmkcl: $(MPI_OBJ) $(STATIC)
	$(call say,LD,$@)
	$(Q)$(CC) $(LINK) $^ -o $@ $(LDLIBS) $(MPI_LIBS)
.PHONY: mpi
mpi: $(MPI_B)/dmkcl

# ---- tests -----------------------------------------------------------------------------------

$B/tests/%: $B/tests/%.o $(TEST_LIB_OBJ) $(STATIC)
	$(call say,LD,$@)
	$(Q)$(CC) $(LINK) $^ -o $@ -lcmocka $(LDLIBS)

# Calls of the public functions with wrong arguments, from the header.
$B/arguments.h: tests/arguments.awk tests/test_arguments.c include/dmkcl.h
	@mkdir -p $(@D)
	$(Q){ cat tests/test_arguments.c; echo ';%'; $(CC) -E -P include/dmkcl.h; } | \
	    awk -f tests/arguments.awk > $@.tmp && mv $@.tmp $@
$B/tests/test_arguments.o: $B/arguments.h
$B/tests/test_arguments.o: private FLAGS += -I$B

test: $(TESTS) $(STATIC) $(SHARED) $(TOOL) $B/faults/library $B/faults/dmkcl $B/bench-anderson $B/bench-kernels
	@sh tests/run.sh $B $(TEST_SCRIPTS) $(TESTS)

# ---- fuzzing ---------------------------------------------------------------------------------

.PHONY: fuzz fuzzers replayers faults
FUZZERS := $(patsubst tests/fuzz/%.c,%,$(filter-out %/replay.c,$(wildcard tests/fuzz/*.c)))
FUZZ_CLI_OBJ := $(addprefix $B/src/cli/,sources.o text.o exit.o interrupt.o)

# libFuzzer's main, or for any compiler the one of replay.c.
$B/fuzz/%: $B/tests/fuzz/%.o $(FUZZ_CLI_OBJ) $(STATIC)
	@mkdir -p $(@D)
	$(call say,LD,$@)
	$(Q)$(CC) $(subst fuzzer-no-link,fuzzer,$(LINK)) $^ -o $@ $(LDLIBS)
$B/replay/%: $B/tests/fuzz/%.o $B/tests/fuzz/replay.o $(FUZZ_CLI_OBJ) $(STATIC)
	@mkdir -p $(@D)
	$(call say,LD,$@)
	$(Q)$(CC) $(LINK) $^ -o $@ $(LDLIBS)
fuzzers: $(FUZZERS:%=$B/fuzz/%)
replayers: $(FUZZERS:%=$B/replay/%)

# FUZZ_SECONDS for all drivers together; what is found and learned stays in build/fuzz/found, .../learned.
FUZZ_SECONDS ?= 240
fuzz: | $(PACKAGES)
	@sh .ci/deps.sh install .ci/check-packages
	$(Q)$(MAKE) --no-print-directory CONFIG=fuzz CC=clang fuzzers
	$(Q)sh tests/fuzz/run.sh build/fuzz $(FUZZ_SECONDS) $(FUZZERS)

# ---- faults ----------------------------------------------------------------------------------

# The library's and the tool's calls for memory, files and OpenCL come to tests/faults/wrap.c first.
WRAP_OBJ := $B/tests/faults/wrap.o
WRAP = $$(nm $(WRAP_OBJ) | sed -n 's/.* T __wrap_\(.*\)/-Wl,--wrap=\1/p')
$B/faults/library: $B/tests/faults/library.o $(WRAP_OBJ) $(STATIC)
	@mkdir -p $(@D)
	$(call say,LD,$@)
	$(Q)$(CC) $(LINK) $^ $(WRAP) -o $@ $(LDLIBS)
$B/faults/dmkcl: $(CLI_OBJ) $(WRAP_OBJ) $(STATIC)
	@mkdir -p $(@D)
	$(call say,LD,$@)
	$(Q)$(CC) $(LINK) $^ $(WRAP) -o $@ $(LDLIBS)

$(MPI_B)/faults/dmkcl: $(MPI_OBJ) $(WRAP_OBJ) $(STATIC)
	@mkdir -p $(@D)
	$(call say,LD,$@)
	$(Q)$(CC) $(LINK) $^ $(WRAP) -o $@ $(LDLIBS) $(MPI_LIBS)

# Each call of the library in turn (FAULT_STRIDE=1), and FAULT_RUNS of the tool for each command and kind.
FAULT_STRIDE ?= 1
FAULT_RUNS ?= 20
faults: $B/faults/library $B/faults/dmkcl
	$(Q)$B/faults/library $(FAULT_STRIDE)
	$(Q)bash tests/faults/tool.sh $B $(FAULT_RUNS)

# Each test STEADY_RUNS times, with and without other work beside it: hours. STEADY='tests/test_x.sh ...' takes some.
STEADY_RUNS ?= 200
STEADY ?= $(TESTS) $(TEST_SCRIPTS)
.PHONY: steady
steady: $(TESTS) $(STATIC) $(SHARED) $(TOOL) $B/faults/library $B/faults/dmkcl
	$(Q)bash tests/steady.sh $B $(STEADY_RUNS) $(STEADY)

# HOSTILE random meshes through all commands, and INTERRUPTED runs that end at random moments: see the scripts.
HOSTILE ?= 2000
INTERRUPTED ?= 500
.PHONY: hostile interrupts
hostile: $(TOOL)
	$(Q)python3 tests/hostile.py $(TOOL) $(HOSTILE) --keep build/hostile
interrupts: $(TOOL)
	$(Q)python3 tests/interrupts.py $(TOOL) $(INTERRUPTED)

# Small wrong changes of the sources, and whether a test notices: see tests/mutate/mutate.py. Ten minutes until it is
# known which test reaches which line, then a few seconds for each change; MUTATE='--seconds 600' does a part.
MUTANTS ?= 300
MUTATE ?=
.PHONY: mutate
mutate: | $(PACKAGES)
	$(Q)python3 tests/mutate/mutate.py --count $(MUTANTS) $(MUTATE)

# Meshes of scanners, from the Debian archive, and one of a million triangles; best with CONFIG=sanitize.
.PHONY: real
real: $(TOOL)
	$(Q)sh tests/real.sh $B $(REAL_MESHES)

# Share of the lines of src/ that the tests run, file by file, the least covered first.
coverage:
	$(Q)find build/coverage -name '*.gcda' -delete 2> /dev/null || true
	$(Q)$(MAKE) -s CONFIG=coverage test
	$(Q)find build/coverage/src -name '*.gcda' -exec gcov -n {} + 2> /dev/null | \
	    awk -F"[':% ]+" '/^File/ { f = $$2 } /^Lines/ && f ~ /^src/ { print $$3 "% of", $$5, f; f = "" }' | \
	    sort -n

# The virtual environment of tests and pictures: see tests/pyenv.sh.
pyenv: | $(PACKAGES)
	$(Q)sh tests/pyenv.sh

# ---- checks ----------------------------------------------------------------------------------

# Beyond `make test`: check-NAME for each script of tests/checks, and all with a table: check-all.
# Seconds of check-soak, solves of check-long: SOAK_SECONDS, DMKCL_LONG.
CHECKS := $(patsubst tests/checks/%.sh,check-%,$(filter-out %/lib.sh,$(wildcard tests/checks/*.sh)))
.PHONY: $(CHECKS)
$(CHECKS): check-%: $(TESTS) $(STATIC) $(SHARED) $(TOOL)
	@sh .ci/deps.sh install .ci/check-packages
	@DMKCL_BUILD=$B DMKCL_LIBS='$(LDLIBS)' bash tests/checks/$*.sh

# What continuous integration runs: all tests, and each tool in a short form. The last line counts all.
.PHONY: ci
ci: $(TESTS) $(STATIC) $(SHARED) $(TOOL)
	@sh .ci/deps.sh install .ci/check-packages
	@sh .ci/deps.sh install .ci/mpi-packages
	@CHECK_SHORT=1 DMKCL_BUILD=$B DMKCL_LIBS='$(LDLIBS)' bash tests/checks/all.sh

# ---- demo ------------------------------------------------------------------------------------

# The paper's first example: the torus of radii 2 and 1, seen from the point (3, 0, 0).
demo: $(TOOL)
	@mkdir -p build/demo
	$(Q)$(TOOL) mesh torus --refine 2 --source 3,0,0 --out build/demo/torus.off
	$(Q)$(TOOL) solve build/demo/torus.off --source 3,0,0 --out build/demo/torus.vtp \
	    --locus build/demo/torus_locus.obj --report build/demo/torus.json

# ---- benchmarks ------------------------------------------------------------------------------

# BENCH=quick, usual or full: see bench/bench.py. The peers come from PyPI into a folder of their own.
BENCH ?= usual
PEERS := build/peers/installed-1.ok
$(PEERS):
	$(Q)python3 -m venv build/peers
	$(Q)build/peers/bin/pip -q install numpy==2.4.6 scipy==1.17.1 potpourri3d==1.4.0 pygeodesic==0.1.11
	@touch $@
bench: $(TOOL) $(PEERS)
	$(Q)build/peers/bin/python bench/bench.py $(BENCH) --program $(TOOL)

# Kernels beside a plain copy of as many bytes.
$B/bench-kernels: $B/bench/kernels.o $(STATIC)
	$(call say,LD,$@)
	$(Q)$(CC) $(LINK) $^ -o $@ $(LDLIBS)
bench-kernels: $B/bench-kernels
	$(Q){ echo '# Kernels beside a plain copy of as many bytes'; echo; $<; } > $B/kernels.md
	$(Q)mv $B/kernels.md bench/results/kernels.md && cat bench/results/kernels.md

# Anderson acceleration of the explicit steps; bench/methods.py runs it.
$B/bench-anderson: $B/bench/anderson.o $(STATIC)
	$(call say,LD,$@)
	$(Q)$(CC) $(LINK) $^ -o $@ $(LDLIBS)
bench-anderson: $B/bench-anderson

# Density error of each method against its steps and V-cycles.
bench-methods: $(TOOL) $B/bench-anderson $(PEERS)
	$(Q)build/peers/bin/python bench/methods.py --program $(TOOL) --anderson $B/bench-anderson

# What several ranks send, counted and modelled; RANKS_TRIANGLES=269000.
RANKS_TRIANGLES ?= 269000
bench-ranks: $(MPI_B)/dmkcl
	$(Q)python3 bench/ranks.py --program $< --triangles $(RANKS_TRIANGLES)

# Every experiment of the paper: figures and a table in build/paper, small ones in bench/results/paper.
paper: $(TOOL) pyenv
	$(Q)build/pyenv/bin/python bench/paper.py --program $(TOOL) --out build/paper --small bench/results/paper

# ---- install ---------------------------------------------------------------------------------

$(PC): $B/flags include/dmkcl.h FORCE
	$(Q)printf '%s\n' 'prefix=$(PREFIX)' 'libdir=$(libdir)' 'includedir=$(includedir)' '' 'Name: dmkcl' \
	    'Description: Cut locus of a point on a triangulated surface, by optimal transport' \
	    'Version: $(VERSION)' 'Cflags: -I$${includedir}' 'Libs: -L$${libdir} -ldmkcl' \
	    'Libs.private: $(LDLIBS)' > $@

$B/dmkcl.1: $(TOOL) src/cli/man.sh
	$(Q)sh src/cli/man.sh $(TOOL) > $@

$B/dmkcl.3: include/dmkcl.h src/docs/reference.awk
	@mkdir -p $(@D)
	$(Q)awk -v version=$(VERSION) -f src/docs/reference.awk $< > $@

# The HTML pages: reference of tool, library and package, a page for each algorithm, the tutorial. See src/docs/README.md.
DOCS := build/docs
DOCS_PYTHON := build/docs-env/bin/python
docs: $(TOOL)
	@sh .ci/deps.sh install .ci/docs-packages
	$(Q)sh tests/pyenv.sh build/docs-env src/docs/requirements.txt
	$(Q)DMKCL_BUILD=$(abspath $(DOCS))/package $(DOCS_PYTHON) -m pip -q install --no-build-isolation --no-deps \
	    --force-reinstall ./src/python
	$(Q)rm -rf $(DOCS)/html $(DOCS)/doxygen && doxygen src/docs/Doxyfile
	$(Q)$(DOCS_PYTHON) src/docs/pictures.py src/docs/pictures && cp bench/results/torus.png src/docs/pictures/
	$(Q)DMKCL_DOXYGEN=$(abspath $(DOCS))/doxygen $(DOCS_PYTHON) -m sphinx -q -W --keep-going -b html \
	    -d $(DOCS)/trees src/docs $(DOCS)/html
	@echo $(DOCS)/html/index.html

D := $(DESTDIR)
install: $(STATIC) $(SHARED) $(TOOL) $(PC) $(MAN) $(MAN3)
	$(call say,INSTALL,$D$(PREFIX))
	$(Q)install -d $D$(bindir) $D$(libdir)/pkgconfig $D$(includedir) $D$(mandir)/man1 $D$(mandir)/man3 \
	    $D$(completionsdir)
	$(Q)install -m 755 $(TOOL) $D$(bindir)/
	$(Q)install -m 644 include/dmkcl.h $D$(includedir)/
	$(Q)install -m 644 $(STATIC) $D$(libdir)/
	$(Q)install -m 755 $(SHARED) $D$(libdir)/
	$(Q)ln -sf $(notdir $(SHARED)) $D$(libdir)/$(SONAME)
	$(Q)ln -sf $(SONAME) $D$(libdir)/libdmkcl.so
	$(Q)install -m 644 $(PC) $D$(libdir)/pkgconfig/
	$(Q)install -m 644 $(MAN) $D$(mandir)/man1/
	$(Q)install -m 644 $(MAN3) $D$(mandir)/man3/
	$(Q)install -m 644 src/cli/completion.bash $D$(completionsdir)/dmkcl
	$(Q)[ -n "$D" ] || ldconfig -p 2> /dev/null | grep -q '$(libdir)/$(SONAME)' || \
	    echo 'Programs that link to $(libdir)/libdmkcl.so find it after `ldconfig` (as root), with' \
	    '`export LD_LIBRARY_PATH=$(libdir)`, or linked with -Wl,-rpath,$(libdir).'

# All that a build and the tests need, as one archive.
dist:
	@mkdir -p build
	$(Q)tar -czf build/dmkcl-$(VERSION).tar.gz --exclude=./build --exclude=./.git --exclude=__pycache__ \
	    --exclude='*.so' --exclude='*.egg-info' --exclude=./src/python/dmkcl/dmkcl --exclude=./src/docs/pictures \
	    --transform 's,^\.,dmkcl-$(VERSION),' .
	@echo build/dmkcl-$(VERSION).tar.gz

uninstall:
	rm -f $D$(bindir)/dmkcl $D$(includedir)/dmkcl.h $D$(libdir)/libdmkcl.a $D$(libdir)/libdmkcl.so \
	    $D$(libdir)/$(SONAME) $D$(libdir)/$(notdir $(SHARED)) $D$(libdir)/pkgconfig/dmkcl.pc \
	    $D$(mandir)/man1/dmkcl.1 $D$(mandir)/man3/dmkcl.3 $D$(completionsdir)/dmkcl

clean:
	rm -rf build

help:
	@echo 'make            library, tool and test programs, in build/$$(CONFIG)'
	@echo 'make test       run all tests; the last line counts them'
	@echo 'make ci         the tests, and compilers, analysers, sanitizers, ... in short'
	@echo 'make fuzz       fuzz all readers with clang; FUZZ_SECONDS=240 for all drivers together'
	@echo 'make MPI=1      also build/mpi/dmkcl, for mpirun: see src/ranks/RANKS.md'
	@echo 'make real       scanned meshes through all commands; REAL_MESHES=folder where they are there'
	@echo 'make hostile    HOSTILE=2000 random meshes of all kinds through all commands'
	@echo 'make interrupts INTERRUPTED=500 runs, interrupted at random moments'
	@echo 'make mutate     MUTANTS=300 wrong changes of the sources, and whether a test notices each'
	@echo 'make steady     each test STEADY_RUNS=200 times, with and without load: does any fail now and then?'
	@echo 'make faults     memory, files, OpenCL and signals fail in turn; FAULT_STRIDE=1 FAULT_RUNS=20'
	@echo 'make check-all  all checks, with a table of what was tried; also by themselves:'
	@echo '                $(CHECKS:check-%=%)'
	@echo 'make coverage   how much of the sources the tests run, by file'
	@echo 'make demo       solve the torus of the paper; files in build/demo'
	@echo 'make paper      the experiments of the paper: figures and a table in build/paper'
	@echo 'make bench      whole runs beside peers from PyPI; BENCH=quick|usual|full'
	@echo 'make bench-kernels, make bench-methods   kernels beside a copy; methods by error'
	@echo 'make bench-anderson   the program that bench-methods runs for Anderson acceleration'
	@echo 'make docs       the HTML pages: reference, algorithms, tutorial; in build/docs/html'
	@echo 'make deps       install missing Debian packages (demo, tests and checks do this too)'
	@echo 'make install    tool, libraries, header, dmkcl.pc, manual; uninstall takes them away'
	@echo 'make dist       the sources as build/dmkcl-VERSION.tar.gz'
	@echo 'make clean      remove build/'
	@echo
	@echo 'CONFIG=release|debug|sanitize|thread|coverage|fuzz   flags, and the folder build/$$(CONFIG)'
	@echo 'WERROR=1                                 warnings are errors'
	@echo 'PREFIX=/usr/local  DESTDIR=              where to install; prefix= means the same'
	@echo 'ARCH=native        the -march of gcc; for other machines ARCH=x86-64-v3, or ARCH= for any'
	@echo 'CC=gcc  CFLAGS=  LDFLAGS=  V=1           compiler, flags to add, show commands'

-include $(LIB_OBJ:.o=.d) $(CLI_OBJ:.o=.d) $(MPI_OBJ:.o=.d) $(TEST_OBJ:.o=.d) $(TEST_LIB_OBJ:.o=.d) $B/bench/kernels.d \
    $B/bench/anderson.d $(FUZZERS:%=$B/tests/fuzz/%.d) $B/tests/fuzz/replay.d \
    $B/tests/faults/wrap.d $B/tests/faults/library.d
