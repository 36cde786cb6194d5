/* A webcam that is not there, for programs that talk to the kernel: preloaded, it answers open, mmap and ioctl.
 *
 *     FAKE_CAMERA=/dev/shm/camera FAKE_PICTURES=folder LD_PRELOAD=fake_v4l2.so program
 *
 * Opening FAKE_CAMERA for reading and writing gives a camera of 640x480 or 320x240 px, YUYV or MJPG, 30 pictures
 * a second: the files 0.jpg to 39.jpg of FAKE_PICTURES in turn, stamped LATE_US before they come, with rubbish
 * behind them in the buffer. Where that folder holds a file "hang" no picture comes; where it holds "gone" the
 * camera is unplugged. The descriptor is a timer's, so that select waits as for a real camera.
 */
#define _GNU_SOURCE
#include <dlfcn.h> /* what is behind us */
#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

enum { BUFFERS = 8, BUFFER_BYTES = 1 << 20, RUBBISH_BYTES = 100, PICTURES = 40, FPS = 30, LATE_US = 40000 };
enum { DESCRIPTORS = 1024 };

struct control {
    uint32_t id;
    const char *name;
    int32_t lowest, highest, value;
};

static struct control controls[] = {
    {V4L2_CID_AUTO_WHITE_BALANCE, "White Balance, Automatic", 0, 1, 1},
    {V4L2_CID_WHITE_BALANCE_TEMPERATURE, "White Balance Temperature", 2800, 6500, 4600},
    {V4L2_CID_EXPOSURE_AUTO, "Auto Exposure", 0, 3, 3},
    {V4L2_CID_EXPOSURE_ABSOLUTE, "Exposure Time, Absolute", 3, 2047, 157},
    {V4L2_CID_EXPOSURE_AUTO_PRIORITY, "Exposure, Dynamic Framerate", 0, 1, 1},
    {V4L2_CID_FOCUS_ABSOLUTE, "Focus, Absolute", 0, 250, 30},
    {V4L2_CID_FOCUS_AUTO, "Focus, Automatic Continuous", 0, 1, 1},
};
static const size_t control_count = sizeof controls / sizeof *controls;

static bool is_ours[DESCRIPTORS];
static void *memory[BUFFERS];
static bool queued[BUFFERS];
static uint32_t buffer_count, next_picture;
static struct v4l2_pix_format format = {.width = 640, .height = 480, .pixelformat = V4L2_PIX_FMT_YUYV};

static int fail(int error)
{
    errno = error;
    return -1;
}

static bool ours(int fd)
{
    return fd >= 0 && fd < DESCRIPTORS && is_ours[fd];
}

static bool told_to(const char *fault)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%s", getenv("FAKE_PICTURES"), fault);
    return access(path, F_OK) == 0;
}

static void run(int fd, bool on)
{
    const struct timespec period = {0, on ? 1000000000 / FPS : 0};
    const struct itimerspec when = {period, period};
    timerfd_settime(fd, 0, &when, NULL);
}

static int query_control(struct v4l2_queryctrl *query)
{
    const bool next = query->id & V4L2_CTRL_FLAG_NEXT_CTRL;
    const uint32_t id = query->id & ~V4L2_CTRL_FLAG_NEXT_CTRL;
    const struct control *found = NULL;
    for (size_t k = 0; k < control_count; k++) {
        const struct control *one = &controls[k];
        if (next ? one->id > id && (!found || one->id < found->id) : one->id == id)
            found = one;
    }
    if (!found)
        return fail(EINVAL);
    memset(query, 0, sizeof *query);
    query->id = found->id;
    query->type = V4L2_CTRL_TYPE_INTEGER;
    snprintf((char *)query->name, sizeof query->name, "%s", found->name);
    query->minimum = found->lowest;
    query->maximum = found->highest;
    query->step = 1;
    return 0;
}

static int control(struct v4l2_control *asked, bool set)
{
    for (size_t k = 0; k < control_count; k++) {
        if (controls[k].id != asked->id)
            continue;
        if (set)
            controls[k].value = asked->value;
        asked->value = controls[k].value;
        return 0;
    }
    return fail(EINVAL);
}

static void agree(struct v4l2_pix_format *asked)
{
    const bool small = asked->width < 480, jpeg = asked->pixelformat == V4L2_PIX_FMT_MJPEG;
    format.width = small ? 320 : 640;
    format.height = small ? 240 : 480;
    format.pixelformat = jpeg ? V4L2_PIX_FMT_MJPEG : V4L2_PIX_FMT_YUYV;
}

static uint32_t fill(uint8_t *buffer)
{
    const uint32_t number = next_picture++ % PICTURES;
    if (format.pixelformat == V4L2_PIX_FMT_YUYV) {
        memset(buffer, (int)number, format.width * format.height * 2);
        return format.width * format.height * 2;
    }
    char path[512];
    snprintf(path, sizeof path, "%s/%u.jpg", getenv("FAKE_PICTURES"), number);
    FILE *file = fopen(path, "rb");
    const size_t bytes = file ? fread(buffer, 1, BUFFER_BYTES - RUBBISH_BYTES, file) : 0;
    if (file)
        fclose(file);
    memset(buffer + bytes, 0x5a, RUBBISH_BYTES);
    return (uint32_t)bytes + RUBBISH_BYTES;
}

static int dequeue(int fd, struct v4l2_buffer *buffer)
{
    uint64_t ticks;
    if (told_to("gone"))
        return fail(ENODEV);
    if (told_to("hang"))
        run(fd, false);
    if (read(fd, &ticks, sizeof ticks) != sizeof ticks)
        return fail(EAGAIN);
    for (uint32_t k = 0; k < buffer_count; k++) {
        if (!queued[k])
            continue;
        struct timespec now;
        clock_gettime(CLOCK_MONOTONIC, &now);
        const int64_t stamp_us = now.tv_sec * INT64_C(1000000) + now.tv_nsec / 1000 - LATE_US;
        queued[k] = false;
        buffer->index = k;
        buffer->bytesused = fill(memory[k]);
        buffer->length = BUFFER_BYTES;
        buffer->flags = V4L2_BUF_FLAG_DONE | V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
        buffer->timestamp.tv_sec = stamp_us / 1000000;
        buffer->timestamp.tv_usec = stamp_us % 1000000;
        return 0;
    }
    return fail(EAGAIN);
}

static int answer(int fd, uint32_t request, void *argument)
{
    switch (request) {
    case VIDIOC_QUERYCAP: {
        struct v4l2_capability *camera = argument;
        memset(camera, 0, sizeof *camera);
        strcpy((char *)camera->card, "Fake Camera");
        camera->device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
        camera->capabilities = camera->device_caps | V4L2_CAP_DEVICE_CAPS;
        return 0;
    }
    case VIDIOC_G_FMT:
    case VIDIOC_S_FMT: {
        struct v4l2_format *asked = argument;
        if (request == VIDIOC_S_FMT)
            agree(&asked->fmt.pix);
        asked->fmt.pix = format;
        return 0;
    }
    case VIDIOC_G_PARM:
    case VIDIOC_S_PARM: {
        struct v4l2_captureparm *asked = &((struct v4l2_streamparm *)argument)->parm.capture;
        asked->timeperframe.numerator = 1;
        asked->timeperframe.denominator = FPS;
        return 0;
    }
    case VIDIOC_REQBUFS: {
        struct v4l2_requestbuffers *asked = argument;
        asked->count = buffer_count = asked->count < BUFFERS ? asked->count : BUFFERS;
        memset(queued, 0, sizeof queued);
        return 0;
    }
    case VIDIOC_QUERYBUF: {
        struct v4l2_buffer *buffer = argument;
        buffer->length = BUFFER_BYTES;
        buffer->m.offset = buffer->index * BUFFER_BYTES;
        return 0;
    }
    case VIDIOC_QBUF:
        queued[((struct v4l2_buffer *)argument)->index] = true;
        return 0;
    case VIDIOC_DQBUF:
        return dequeue(fd, argument);
    case VIDIOC_STREAMON:
    case VIDIOC_STREAMOFF:
        run(fd, request == VIDIOC_STREAMON);
        return 0;
    case VIDIOC_ENUM_FMT: {
        struct v4l2_fmtdesc *asked = argument;
        asked->pixelformat = asked->index ? V4L2_PIX_FMT_MJPEG : V4L2_PIX_FMT_YUYV;
        return asked->index > 1 ? fail(EINVAL) : 0;
    }
    case VIDIOC_ENUM_FRAMESIZES: {
        struct v4l2_frmsizeenum *asked = argument;
        asked->type = V4L2_FRMSIZE_TYPE_DISCRETE;
        asked->discrete.width = asked->index ? 320 : 640;
        asked->discrete.height = asked->index ? 240 : 480;
        return asked->index > 1 ? fail(EINVAL) : 0;
    }
    case VIDIOC_ENUM_FRAMEINTERVALS: {
        struct v4l2_frmivalenum *asked = argument;
        asked->type = V4L2_FRMIVAL_TYPE_DISCRETE;
        asked->discrete.numerator = 1;
        asked->discrete.denominator = FPS;
        return asked->index > 0 ? fail(EINVAL) : 0;
    }
    case VIDIOC_QUERYCTRL:
        return query_control(argument);
    case VIDIOC_G_CTRL:
    case VIDIOC_S_CTRL:
        return control(argument, request == VIDIOC_S_CTRL);
    }
    return fail(told_to("gone") ? ENODEV : ENOTTY);
}

int ioctl(int fd, unsigned long request, ...)
{
    va_list rest;
    va_start(rest, request);
    void *argument = va_arg(rest, void *);
    va_end(rest);
    if (ours(fd))
        return answer(fd, (uint32_t)request, argument);
    int (*behind)(int, unsigned long, ...) = dlsym(RTLD_NEXT, "ioctl");
    return behind(fd, request, argument);
}

int close(int fd)
{
    if (ours(fd))
        is_ours[fd] = false;
    int (*behind)(int) = dlsym(RTLD_NEXT, "close");
    return behind(fd);
}

#define OPEN(NAME)                                                                              \
    int NAME(const char *path, int flags, ...)                                                  \
    {                                                                                           \
        va_list rest;                                                                           \
        va_start(rest, flags);                                                                  \
        const mode_t mode = va_arg(rest, mode_t);                                               \
        va_end(rest);                                                                           \
        const char *camera = getenv("FAKE_CAMERA");                                             \
        if (camera && !strcmp(path, camera) && (flags & O_ACCMODE) == O_RDWR) {                 \
            if (told_to("gone"))                                                                \
                return fail(ENODEV);                                                            \
            const int fd = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);         \
            is_ours[fd] = true;                                                                 \
            return fd;                                                                          \
        }                                                                                       \
        int (*behind)(const char *, int, ...) = dlsym(RTLD_NEXT, #NAME);                        \
        return behind(path, flags, mode);                                                       \
    }
OPEN(open)
OPEN(open64)

#define MMAP(NAME)                                                                              \
    void *NAME(void *at, size_t bytes, int protection, int flags, int fd, off_t offset)         \
    {                                                                                           \
        void *(*behind)(void *, size_t, int, int, int, off_t) = dlsym(RTLD_NEXT, #NAME);        \
        if (!ours(fd))                                                                          \
            return behind(at, bytes, protection, flags, fd, offset);                            \
        protection |= PROT_WRITE;                                                               \
        return memory[offset / BUFFER_BYTES] =                                                  \
                   behind(NULL, bytes, protection, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);         \
    }
MMAP(mmap)
MMAP(mmap64)
