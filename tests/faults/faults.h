/* Calls that fail on order: memory, files, OpenCL. Linked with --wrap (see the Makefile), so that the
 * project's own calls come here and those of other libraries do not. */
#ifndef DMK_FAULTS_H
#define DMK_FAULTS_H

#include <stdbool.h>

typedef enum fault_kind { FAULT_NONE, FAULT_MEMORY, FAULT_FILE, FAULT_OPENCL } fault_kind;

/* What happens at the call: it fails, or a signal is raised and it goes on. */
typedef struct fault {
    fault_kind kind;
    long at;      /* from 1: the at-th call of this kind from now on */
    bool lasting; /* and every one behind it */
    int code;     /* FAULT_OPENCL: the error; FAULT_FILE: errno */
    int signal;   /* 0: fail */
    bool renewed; /* FAULT_OPENCL, lasting: until devices are looked for again */
} fault;

void fault_arm(const fault *fault);
/* Number of calls of the kind since fault_arm. */
long fault_disarm(void);
/* Blocks of memory, open files, OpenCL objects and the like that were not given back. */
long fault_live(void);

#endif
