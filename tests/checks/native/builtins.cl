/* The functions of OpenCL C that the kernels use, in OpenCL C itself, for kernels that are compiled
 * for the processor. Vectors go number by number, so that each access is watched. */
#define OVER __attribute__((overloadable))

size_t native_group(void);
size_t native_groups(void);
size_t native_local(void);
size_t native_local_size(void);
size_t native_global(void);
void native_barrier(void);
size_t OVER get_group_id(uint d) { return native_group(); }
size_t OVER get_num_groups(uint d) { return native_groups(); }
size_t OVER get_local_id(uint d) { return native_local(); }
size_t OVER get_local_size(uint d) { return native_local_size(); }
size_t OVER get_global_id(uint d) { return native_global(); }
void OVER barrier(cl_mem_fence_flags flags) { native_barrier(); }

float sqrtf(float);
float expf(float);
float logf(float);
float floorf(float);
float OVER sqrt(float x) { return sqrtf(x); }
float OVER exp(float x) { return expf(x); }
float OVER log(float x) { return logf(x); }
float OVER floor(float x) { return floorf(x); }
float OVER fabs(float x) { return x < 0 ? -x : x; }
float OVER fmax(float a, float b) { return a >= b || b != b ? a : b; }
float OVER fmin(float a, float b) { return a <= b || b != b ? a : b; }
float OVER clamp(float x, float lo, float hi) { return fmin(fmax(x, lo), hi); }
int OVER min(int a, int b) { return a < b ? a : b; }
int OVER max(int a, int b) { return a > b ? a : b; }
int OVER clamp(int x, int lo, int hi) { return min(max(x, lo), hi); }
int OVER atomic_cmpxchg(volatile global int *p, int old, int x)
{
    return __sync_val_compare_and_swap(p, old, x);
}
int OVER atomic_inc(volatile global int *p) { return __sync_fetch_and_add(p, 1); }
int OVER atomic_xchg(volatile global int *p, int x) { return __sync_lock_test_and_set(p, x); }
int OVER atomic_or(volatile global int *p, int x) { return __sync_fetch_and_or(p, x); }
void OVER mem_fence(cl_mem_fence_flags flags) { __sync_synchronize(); }
int OVER atomic_max(volatile global int *p, int x) { return __sync_fetch_and_max(p, x); }

/* Numbers of half precision by their bits: no type of the processor is needed. */
float OVER vload_half(size_t i, const global half *p)
{
    const uint h = ((const global ushort *)p)[i], size = h & 0x7fff;
    union {
        uint u;
        float f;
    } v = {.u = (size << 13) + (112 << 23)};
    if (size < 0x400) v.f = (float)size / 16777216.0f; /* 2^24 */
    return h & 0x8000 ? -v.f : v.f;
}

double native_sqrt(double);
double native_exp(double);
double native_log(double);
double OVER sqrt(double x) { return native_sqrt(x); }
double OVER exp(double x) { return native_exp(x); }
double OVER log(double x) { return native_log(x); }
double OVER fabs(double x) { return x < 0 ? -x : x; }
double OVER fmax(double a, double b) { return a >= b || b != b ? a : b; }
double OVER fmin(double a, double b) { return a <= b || b != b ? a : b; }
double OVER clamp(double x, double lo, double hi) { return fmin(fmax(x, lo), hi); }

#define EIGHT(f, x) f(x.s0), f(x.s1), f(x.s2), f(x.s3), f(x.s4), f(x.s5), f(x.s6), f(x.s7)
#define EIGHT2(f, x, y)                                                                            \
    f(x.s0, y.s0), f(x.s1, y.s1), f(x.s2, y.s2), f(x.s3, y.s3), f(x.s4, y.s4), f(x.s5, y.s5),      \
        f(x.s6, y.s6), f(x.s7, y.s7)
#define VECTOR(scalar, vector)                                                                     \
    vector OVER sqrt(vector x) { return (vector)(EIGHT(sqrt, x)); }                                \
    vector OVER exp(vector x) { return (vector)(EIGHT(exp, x)); }                                  \
    vector OVER log(vector x) { return (vector)(EIGHT(log, x)); }                                  \
    vector OVER fabs(vector x) { return (vector)(EIGHT(fabs, x)); }                                \
    vector OVER fmax(vector x, vector y) { return (vector)(EIGHT2(fmax, x, y)); }                  \
    vector OVER fmin(vector x, vector y) { return (vector)(EIGHT2(fmin, x, y)); }                  \
    vector OVER fmax(vector x, scalar y) { return fmax(x, (vector)y); }                            \
    vector OVER clamp(vector x, vector lo, vector hi) { return fmin(fmax(x, lo), hi); }            \
    vector OVER clamp(vector x, scalar lo, scalar hi) { return clamp(x, (vector)lo, (vector)hi); }
#define MEMORY(scalar, vector)                                                                     \
    vector OVER vload8(size_t i, const global scalar *p)                                           \
    {                                                                                              \
        p += 8 * i;                                                                                \
        return (vector)(p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7]);                           \
    }                                                                                              \
    void OVER vstore8(vector x, size_t i, global scalar *p)                                        \
    {                                                                                              \
        p += 8 * i;                                                                                \
        p[0] = x.s0, p[1] = x.s1, p[2] = x.s2, p[3] = x.s3;                                        \
        p[4] = x.s4, p[5] = x.s5, p[6] = x.s6, p[7] = x.s7;                                        \
    }
VECTOR(float, float8)
VECTOR(double, double8)
MEMORY(float, float8)
MEMORY(double, double8)
MEMORY(int, int8)
float2 OVER vload2(size_t i, const global float *p) { return (float2)(p[2 * i], p[2 * i + 1]); }
void OVER vstore2(float2 x, size_t i, global float *p) { p[2 * i] = x.s0, p[2 * i + 1] = x.s1; }
void OVER vstore8(float8 x, size_t i, private float *p)
{
    p += 8 * i;
    for (int k = 0; k < 8; k++) p[k] = ((private float *)&x)[k];
}
void OVER vstore16(float16 x, size_t i, global float *p)
{
    vstore8(x.lo, 2 * i, p);
    vstore8(x.hi, 2 * i + 1, p);
}
float8 OVER convert_float8(float8 x) { return x; }
float8 OVER convert_float8(double8 x) { return (float8)(EIGHT((float), x)); }
double8 OVER convert_double8(double8 x) { return x; }
double8 OVER convert_double8(float8 x) { return (double8)(EIGHT((double), x)); }
