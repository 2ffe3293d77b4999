// Preloaded into huetrackd: while the file $LOCKED_UP_WHILE exists, $LOCKED_UP_DEVICE is as a webcam that has locked
// up. Whatever has to ask the camera itself takes 5 s and fails, and no frame comes.
#define _GNU_SOURCE
#include <errno.h>
#include <linux/videodev2.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <unistd.h>

int ioctl(int fd, unsigned long request, ...) {
  va_list arguments;
  va_start(arguments, request);
  void* argument = va_arg(arguments, void*);
  va_end(arguments);
  const int asks = request == VIDIOC_G_EXT_CTRLS || request == VIDIOC_S_EXT_CTRLS || request == VIDIOC_S_FMT ||
                   request == VIDIOC_STREAMON || request == VIDIOC_STREAMOFF || request == VIDIOC_DQBUF;
  if (asks && access(getenv("LOCKED_UP_WHILE"), F_OK) == 0) {
    char link[64], path[256];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    const ssize_t length = readlink(link, path, sizeof path - 1);
    path[length > 0 ? length : 0] = 0;
    if (strcmp(path, getenv("LOCKED_UP_DEVICE")) == 0) {
      if (request != VIDIOC_DQBUF) sleep(5);
      if (request != VIDIOC_STREAMOFF) {
        errno = request == VIDIOC_DQBUF ? EAGAIN : ETIMEDOUT;
        return -1;
      }
    }
  }
  return (int)syscall(SYS_ioctl, fd, request, argument);
}
