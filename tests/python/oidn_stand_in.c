/* A stand-in for Open Image Denoise: the functions that the command calls, of the version MAJOR.7.1, whose filter doubles the colours and
   adds base colour and normal. MAJOR 1 lacks what version 2 has. FAULT, if defined, is what the filter reports. NO_DEVICE gives none. */
#include <stddef.h>
#include <stdbool.h>
#include <string.h>

static struct image { float *pixels; size_t stride, row; } color, albedo, normal, output;
static size_t width, height;
static const char *fault;
static bool is_hdr, is_committed;
static int threads;

void *oidnNewDevice(int type)
{
#ifdef NO_DEVICE
	fault = "no such device here";
	return NULL;
#else
	return type == 1 ? &fault : NULL;
#endif
}

int oidnGetDeviceError(void *device, const char **message)
{
	int code = fault != NULL;
	*message = fault;
	fault = NULL;
	return code;
}

void oidnSetDeviceBool(void *device, const char *name, bool value) {}
void oidnCommitDevice(void *device) { is_committed = threads > 0; }
void oidnReleaseDevice(void *device) { is_committed = false; threads = 0; }
void *oidnNewFilter(void *device, const char *type) { return is_committed && !strcmp(type, "RT") ? &color : NULL; }

void oidnSetSharedFilterImage(void *filter, const char *name, void *pixels, int format, size_t w, size_t h, size_t offset, size_t stride, size_t row)
{
	struct image *to = !strcmp(name, "color") ? &color : !strcmp(name, "albedo") ? &albedo : !strcmp(name, "normal") ? &normal : &output;
	*to = (struct image){pixels, stride, row};
	width = w, height = h;
	if (format != 3 || offset != 0) fault = "expected packed pixels of three floats";
}

#if MAJOR > 1
void oidnSetDeviceInt(void *device, const char *name, int value) { if (!strcmp(name, "numThreads")) threads = value; }
int oidnGetDeviceInt(void *device, const char *name) { return !strcmp(name, "versionMajor") ? MAJOR : !strcmp(name, "versionMinor") ? 7 : 1; }
void oidnSetFilterBool(void *filter, const char *name, bool value) { if (!strcmp(name, "hdr")) is_hdr = value; }
#endif
void oidnCommitFilter(void *filter) { if (!is_hdr) fault = "expected scene-linear colours"; }

void oidnExecuteFilter(void *filter)
{
#define AT(of, x, y, c) ((float *)((char *)(of).pixels + (y) * (of).row + (x) * (of).stride))[c]
	for (size_t y = 0; y < height; y++)
		for (size_t x = 0; x < width; x++)
			for (int c = 0; c < 3; c++)
				AT(output, x, y, c) = 2.0f * AT(color, x, y, c) + AT(albedo, x, y, c) + AT(normal, x, y, c);
#ifdef FAULT
	fault = FAULT;
#endif
}

void oidnReleaseFilter(void *filter) {}
