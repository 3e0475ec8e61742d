/*
 * Records the calls that bring files and names to the disk, for LD_PRELOAD: in the file that RATTLEMAP_JOURNAL names, as CALL,
 * INODE, PATH, MORE with tabs between. MORE is the new name of a renamed file, or the size of a synced one. Nothing waits for
 * the disk.
 */
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

/* One call appends the line, because files are written side by side. */
static int noted(const char *call, const struct stat *data, const char *path, const char *more) {
    char line[8192];
    int count = snprintf(line, sizeof line, "%s\t%lu\t%s\t%s\n", call, (unsigned long)data->st_ino, path, more);
    int file = open(getenv("RATTLEMAP_JOURNAL"), O_WRONLY | O_APPEND | O_CREAT, 0600);
    return write(file, line, count) == count ? close(file) : -1;
}

int fsync(int fd) {
    char link[64], path[4096] = "", size[32];
    struct stat data;
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    if (fstat(fd, &data) || readlink(link, path, sizeof path - 1) < 0) return -1;
    snprintf(size, sizeof size, "%ld", (long)data.st_size);
    return noted("sync", &data, path, size);
}

int fdatasync(int fd) { return fsync(fd); }

int rename(const char *from, const char *to) {
    struct stat data;
    return stat(from, &data) || renameat(AT_FDCWD, from, AT_FDCWD, to) || noted("rename", &data, from, to) ? -1 : 0;
}
