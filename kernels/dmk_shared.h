/* Types of both sides, host and device. */
#ifndef DMK_SHARED_H
#define DMK_SHARED_H
#endif
