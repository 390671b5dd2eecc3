#include <string.h>

#include "system.h"

enum { MOST_BYTES = 1 << 26 }; /* of a file */

/* `folder` and `name` with one separator between them */
static char *joined(const char *folder, const char *name)
{
    size_t length = strlen(folder), rest = strlen(name);
    char *path = fmu_allocate(length + rest + 2);
    if (!path)
        return NULL;
    memcpy(path, folder, length);
    if (length && path[length - 1] != '/' && path[length - 1] != '\\')
        path[length++] = '/';
    memcpy(path + length, name, rest);
    return path;
}

#if defined(_WIN32)
#include <windows.h>

int _fltused = 0; /* compilers ask for it where numbers are used without the C runtime */

BOOL WINAPI DllMainCRTStartup(HINSTANCE instance, DWORD reason, LPVOID reserved);
BOOL WINAPI DllMainCRTStartup(HINSTANCE instance, DWORD reason, LPVOID reserved)
{
    (void)instance;
    (void)reason;
    (void)reserved;
    return TRUE;
}

size_t strlen(const char *text)
{
    const volatile char *end = text; /* or a compiler makes this a call of itself */
    while (*end)
        end++;
    return (size_t)(end - text);
}

int strcmp(const char *one, const char *other)
{
    while (*one && *one == *other) {
        one++;
        other++;
    }
    return (unsigned char)*one - (unsigned char)*other;
}

void *fmu_allocate(size_t bytes)
{
    return HeapAlloc(GetProcessHeap(), HEAP_ZERO_MEMORY, bytes);
}

void fmu_free(void *memory)
{
    if (memory)
        HeapFree(GetProcessHeap(), 0, memory);
}

/* UTF-8 as the standard asks for, or what else the importer may have sent */
static wchar_t *wide(const char *path)
{
    UINT page = CP_UTF8;
    int count = MultiByteToWideChar(page, MB_ERR_INVALID_CHARS, path, -1, NULL, 0);
    if (!count) {
        page = CP_ACP;
        count = MultiByteToWideChar(page, 0, path, -1, NULL, 0);
    }
    wchar_t *to = count > 0 ? fmu_allocate((size_t)count * sizeof *to) : NULL;
    if (to)
        MultiByteToWideChar(page, 0, path, -1, to, count);
    return to;
}

static void *content(HANDLE file, size_t *bytes)
{
    LARGE_INTEGER size;
    DWORD got = 0;
    if (!GetFileSizeEx(file, &size) || size.QuadPart <= 0 || size.QuadPart > MOST_BYTES)
        return NULL;
    char *to = fmu_allocate((size_t)size.QuadPart);
    if (to && ReadFile(file, to, (DWORD)size.QuadPart, &got, NULL) && got == (DWORD)size.QuadPart) {
        *bytes = got;
        return to;
    }
    fmu_free(to);
    return NULL;
}

void *fmu_read(const char *folder, const char *name, size_t *bytes)
{
    char *path = joined(folder, name);
    wchar_t *place = path ? wide(path) : NULL;
    void *found = NULL;
    if (place) {
        HANDLE file = CreateFileW(place, GENERIC_READ, FILE_SHARE_READ | FILE_SHARE_DELETE, NULL, OPEN_EXISTING,
                                  FILE_ATTRIBUTE_NORMAL, NULL);
        if (file != INVALID_HANDLE_VALUE) {
            found = content(file, bytes);
            CloseHandle(file);
        }
    }
    fmu_free(place);
    fmu_free(path);
    return found;
}
#else
#include <stdio.h>
#include <stdlib.h>

void *fmu_allocate(size_t bytes)
{
    return calloc(1, bytes);
}

void fmu_free(void *memory)
{
    free(memory);
}

static void *content(FILE *file, size_t *bytes)
{
    if (fseek(file, 0, SEEK_END))
        return NULL;
    long size = ftell(file);
    if (size <= 0 || size > MOST_BYTES || fseek(file, 0, SEEK_SET))
        return NULL;
    char *to = fmu_allocate((size_t)size);
    if (to && fread(to, 1, (size_t)size, file) == (size_t)size) {
        *bytes = (size_t)size;
        return to;
    }
    fmu_free(to);
    return NULL;
}

void *fmu_read(const char *folder, const char *name, size_t *bytes)
{
    char *path = joined(folder, name);
    FILE *file = path ? fopen(path, "rb") : NULL;
    void *found = file ? content(file, bytes) : NULL;
    if (file)
        fclose(file);
    fmu_free(path);
    return found;
}
#endif

static char lower(char letter)
{
    return letter >= 'A' && letter <= 'Z' ? (char)(letter - 'A' + 'a') : letter;
}

/* What follows `start` in the text, whatever its case; NULL if it does not begin so */
static const char *after(const char *text, const char *start)
{
    for (; *start; start++, text++)
        if (lower(*text) != *start)
            return NULL;
    return text;
}

static int digit(char letter)
{
    letter = lower(letter);
    if (letter >= '0' && letter <= '9')
        return letter - '0';
    return letter >= 'a' && letter <= 'f' ? letter - 'a' + 10 : -1;
}

static int is_drive(const char *path)
{
    char letter = lower(path[0]);
    return letter >= 'a' && letter <= 'z' && path[1] == ':';
}

char *fmu_path_of(const char *uri, int decode)
{
    const char *path = after(uri, "file:"), *rest;
    if (!path) {
        path = uri;
        decode = 0;
    } else if ((rest = after(path, "//localhost/"))) {
        path = rest - 1;
    } else if ((rest = after(path, "///"))) {
        path = rest - 1;
    } else if ((rest = after(path, "//")) && is_drive(rest)) {
        path = rest; /* file://C:/... is wrong and common */
    }
    if (path[0] == '/' && is_drive(path + 1))
        path++;
    char *to = fmu_allocate(strlen(path) + 1), *at = to;
    if (!to)
        return NULL;
    while (*path) {
        int high = decode && *path == '%' ? digit(path[1]) : -1, low = high >= 0 ? digit(path[2]) : -1;
        if (low >= 0 && (high || low)) {
            *at++ = (char)(high * 16 + low);
            path += 3;
        } else {
            *at++ = *path++;
        }
    }
    return to;
}
