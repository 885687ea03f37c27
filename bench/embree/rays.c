/* Traces given rays through given quads with Embree 3: one ray per call, on one thread. `pumice bench embree` starts it.
 *
 *   rays MESH     MESH: u64 vertices, u64 quads, then 3 floats a vertex, 4 u32 a quad, counter-clockwise from outside
 *
 * It builds the scene and prints "built CPU-seconds BYTES". BYTES is what Embree itself counts as allocated, with the arrays of the quads.
 * Then it answers each line of standard input:
 *
 *   trace RAYS HITS     RAYS: u64 n, then 8 floats a ray: origin, least t, direction, 0.   HITS: n times (float t, u32 quad)
 *                       prints "traced CPU-seconds", which counts only the tracing
 */
#include <embree3/rtcore.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static ssize_t held, most;

static bool count(void *unused, ssize_t bytes, bool post) {
    (void)unused, (void)post;
    held += bytes;
    if (held > most) most = held;
    return true;
}

static void fail(const char *what, const char *where) {
    fprintf(stderr, "rays: %s %s\n", what, where);
    exit(2);
}

static double cpu_seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

static FILE *opened(const char *path, const char *mode) {
    FILE *file = fopen(path, mode);
    if (!file) fail("cannot open", path);
    return file;
}

static void get(void *to, size_t bytes, FILE *file, const char *path) {
    if (fread(to, 1, bytes, file) != bytes) fail("too short:", path);
}

static void *room(size_t bytes) {
    void *memory = malloc(bytes ? bytes : 1);
    if (!memory) fail("no memory", "");
    return memory;
}

int main(int argc, char **argv) {
    if (argc != 2) fail("usage: rays MESH", "");
    RTCDevice device = rtcNewDevice("threads=1");
    if (!device) fail("Embree does not start", "");
    rtcSetDeviceMemoryMonitorFunction(device, count, NULL);

    FILE *file = opened(argv[1], "rb");
    uint64_t sizes[2];
    get(sizes, sizeof sizes, file, argv[1]);
    double begin = cpu_seconds();
    RTCScene scene = rtcNewScene(device);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    RTCGeometry quads = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_QUAD);
    rtcSetGeometryBuildQuality(quads, RTC_BUILD_QUALITY_HIGH);
    float *vertices = rtcSetNewGeometryBuffer(quads, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, sizes[0]);
    uint32_t *corners = rtcSetNewGeometryBuffer(quads, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT4, 16, sizes[1]);
    if (!vertices || !corners) fail("no memory for", argv[1]);
    get(vertices, 12 * sizes[0], file, argv[1]);
    get(corners, 16 * sizes[1], file, argv[1]);
    fclose(file);
    rtcCommitGeometry(quads);
    rtcAttachGeometry(scene, quads);
    rtcReleaseGeometry(quads);
    rtcCommitScene(scene);
    if (rtcGetDeviceError(device) != RTC_ERROR_NONE) fail("Embree cannot build", argv[1]);
    printf("built %.6f %zd\n", cpu_seconds() - begin, held);
    fflush(stdout);

    char line[8192], rays_path[4096], hits_path[4096];
    while (fgets(line, sizeof line, stdin)) {
        if (sscanf(line, "trace %4095s %4095s", rays_path, hits_path) != 2) fail("not understood:", line);
        uint64_t n;
        file = opened(rays_path, "rb");
        get(&n, sizeof n, file, rays_path);
        float *rays = room(32 * n);
        get(rays, 32 * n, file, rays_path);
        fclose(file);
        struct {
            float t;
            uint32_t quad;
        } *hits = room(8 * n);
        struct RTCIntersectContext context;
        rtcInitIntersectContext(&context);
        begin = cpu_seconds();
        for (uint64_t i = 0; i < n; i++) {
            struct RTCRayHit one;
            memcpy(&one.ray, rays + 8 * i, 32);
            one.ray.tfar = INFINITY;
            one.ray.mask = -1;
            one.ray.id = 0;
            one.ray.flags = 0;
            one.hit.geomID = RTC_INVALID_GEOMETRY_ID;
            one.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
            rtcIntersect1(scene, &context, &one);
            hits[i].t = one.ray.tfar;
            hits[i].quad = one.hit.geomID == RTC_INVALID_GEOMETRY_ID ? UINT32_MAX : one.hit.primID;
        }
        double seconds = cpu_seconds() - begin;
        file = opened(hits_path, "wb");
        if (fwrite(hits, 8, n, file) != n || fclose(file)) fail("cannot write", hits_path);
        free(rays);
        free(hits);
        printf("traced %.6f\n", seconds);
        fflush(stdout);
    }
    return 0;
}
