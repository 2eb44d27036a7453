# dmkcl: `make` builds, `make test` tests, `make demo` shows, `make install` installs.
# CONFIG=release|debug|sanitize|coverage chooses the flags and the folder build/$(CONFIG); V=1 shows commands.
CONFIG ?= release
PREFIX ?= /usr/local
DESTDIR ?=
CC = gcc
B := build/$(CONFIG)
Q := $(if $(V),,@)
VERSION := $(shell awk '/define DMK_VERSION_(MAJOR|MINOR|PATCH)/ { printf "%s%s", s, $$3; s = "." }' include/dmkcl.h)
SOVERSION := $(firstword $(subst ., ,$(VERSION)))

WARN := -Wall -Wextra -Wpedantic -Wshadow -Wstrict-prototypes -Wmissing-prototypes -Wpointer-arith -Wvla -Werror
OPT_release := -O3 -march=native -fno-math-errno
OPT_debug := -O0 -g
OPT_sanitize := -O1 -g -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer
OPT_coverage := -O0 -g --coverage
CFLAGS := -std=c11 -D_GNU_SOURCE -DCL_TARGET_OPENCL_VERSION=120 $(WARN) $(OPT_$(CONFIG)) -fPIC -fvisibility=hidden -Iinclude -Isrc -Ikernels
LDLIBS := -lOpenCL -lhwloc -lpthread -lm

LIB_SRC := $(wildcard src/base/*.c src/mesh/*.c src/io/*.c src/device/*.c src/solver/*.c src/locus/*.c) $(wildcard src/api.c)
CLI_SRC := $(wildcard src/cli/*.c)
LIB_OBJ := $(LIB_SRC:%.c=$B/%.o) $B/kernels.o
CLI_OBJ := $(CLI_SRC:%.c=$B/%.o)
KERNELS := kernels/dmk_shared.h $(sort $(wildcard kernels/*.cl))
TEST_SRC := $(wildcard tests/test_*.c)
TESTS := $(TEST_SRC:tests/%.c=$B/tests/%)

.PHONY: all clean test
all: $B/libdmkcl.a $(if $(CLI_SRC),$B/dmkcl) $(TESTS)

$B/%.o: %.c Makefile
	@mkdir -p $(@D)
	$(if $(V),,@echo "  CC    $<")
	$(Q)$(CC) $(CFLAGS) -MMD -MP -c $< -o $@

# Each kernel file becomes an array of strings, one per line, with a #line that names it in build logs.
$B/kernels.c: $(KERNELS) kernels/embed.sh
	@mkdir -p $(@D)
	$(Q)sh kernels/embed.sh $(KERNELS) > $@.tmp && mv $@.tmp $@
$B/kernels.o: $B/kernels.c
	$(Q)$(CC) $(CFLAGS) -c $< -o $@

$B/libdmkcl.a: $(LIB_OBJ)
	$(if $(V),,@echo "  AR    $@")
	$(Q)rm -f $@ && $(AR) rcs $@ $^
$B/dmkcl: $(CLI_OBJ) $B/libdmkcl.a
	$(if $(V),,@echo "  LD    $@")
	$(Q)$(CC) $(CFLAGS) $^ -o $@ $(LDLIBS)
$B/tests/%: tests/%.c $B/libdmkcl.a
	@mkdir -p $(@D)
	$(if $(V),,@echo "  TEST  $<")
	$(Q)$(CC) $(CFLAGS) -MMD -MP $< $B/libdmkcl.a -o $@ -lcmocka $(LDLIBS)

clean:
	rm -rf build

-include $(LIB_OBJ:.o=.d) $(CLI_OBJ:.o=.d)
