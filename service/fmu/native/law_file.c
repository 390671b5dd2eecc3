#include <string.h>

#include "law_file.h"
#include "system.h"

typedef struct {
    char magic[4];
    uint32_t format, checksum, interface;
    uint64_t numbers;
    char token[FMU_TOKEN_BYTES];
} header;

/* Numbers not yet taken; `left` is negative once more were asked for than there are. */
typedef struct {
    const double *at;
    int64_t left;
} cursor;

static const double nothing[16] = {0.0};

static const double *take(cursor *from, int64_t count)
{
    if (count < 0 || count > from->left) {
        from->left = -1;
        return nothing;
    }
    const double *found = from->at;
    from->at += count;
    from->left -= count;
    return found;
}

static double number(cursor *from)
{
    return *take(from, 1);
}

/* A count that leaves room for what it counts */
static int64_t count(cursor *from, int64_t multiple)
{
    double found = number(from);
    int64_t whole = found >= 1.0 && found <= 1e6 ? (int64_t)found : 0;
    if (!whole || whole % multiple || (double)whole != found)
        from->left = -1;
    return whole;
}

static void take_basis(cursor *from, rover_basis *basis)
{
    enum { LANES = 8 }; /* of law.c */
    basis->count = count(from, LANES);
    for (int i = 0; i < 3; i++)
        basis->scale[i] = number(from);
    basis->centres = take(from, 3 * basis->count);
}

static void take_law(cursor *from, rover_law *law)
{
    double *scalars[] = {&law->number,        &law->gravity_m_s2,    &law->wheel_radius_m, &law->wheelbase_m,
                         &law->centre_ahead_m, &law->centre_height_m, &law->rim_speed_m_s};
    for (size_t i = 0; i < sizeof scalars / sizeof *scalars; i++)
        *scalars[i] = number(from);
    for (int i = 0; i < 6; i++)
        law->reach[i] = number(from);
    take_basis(from, &law->motion);
    take_basis(from, &law->stall);
    law->parameters = take(from, sizeof(rover_parameters) / sizeof(double));
    law->weights = take(from, 2 * law->motion.count + law->stall.count);
    law->heights = take(from, ROVER_HEIGHTS);
}

static void take_release(cursor *from, rover_release *release)
{
    release->slopes = count(from, 1);
    release->masses = count(from, 1);
    release->slope_length_deg = number(from);
    release->mass_length = number(from);
    for (int i = 0; i < 2; i++)
        release->slope_rad[i] = number(from);
    for (int i = 0; i < 2; i++)
        release->mass_kg[i] = number(from);
    release->slope_deg = take(from, release->slopes);
    release->log_mass = take(from, release->masses);
    release->weights = take(from, release->slopes * release->masses);
}

const char *fmu_law_begin(fmu_law *to, void *content, size_t bytes)
{
    header head;
    memset(to, 0, sizeof *to);
    to->content = content;
    if (bytes < sizeof head || memcmp(content, "RVLW", 4))
        return "it is no law of a rover";
    memcpy(&head, content, sizeof head);
    if (head.format != FMU_LAW_FORMAT || head.interface != ROVER_INTERFACE)
        return "it was made for binaries of another release";
    size_t room = bytes - sizeof head;
    if (room % sizeof(double) || head.numbers != room / sizeof(double))
        return "it is cut off, or something was added to it";
    const char *body = (const char *)content + sizeof head;
    if (fmu_checksum(body - FMU_TOKEN_BYTES, room + FMU_TOKEN_BYTES) != head.checksum)
        return "it is damaged: its checksum is another one";
    memcpy(to->token, head.token, FMU_TOKEN_BYTES);
    cursor from = {(const double *)(const void *)body, (int64_t)head.numbers};
    take_law(&from, &to->law);
    take_release(&from, &to->release);
    if (from.left)
        return "it does not hold the numbers of a law";
    to->law.vector_bits = rover_vector_bits();
    return NULL;
}

void fmu_law_end(fmu_law *law)
{
    fmu_free(law->content);
    law->content = NULL;
}

uint32_t fmu_checksum(const void *content, size_t bytes)
{
    static const uint32_t nibbles[16] = {0x00000000, 0x1db71064, 0x3b6e20c8, 0x26d930ac, 0x76dc4190, 0x6b6b51f4,
                                         0x4db26158, 0x5005713c, 0xedb88320, 0xf00f9344, 0xd6d6a3e8, 0xcb61b38c,
                                         0x9b64c2b0, 0x86d3d2d4, 0xa00ae278, 0xbdbdf21c};
    const unsigned char *at = content;
    uint32_t sum = 0xffffffffu;
    for (size_t i = 0; i < bytes; i++) {
        sum ^= at[i];
        sum = (sum >> 4) ^ nibbles[sum & 15];
        sum = (sum >> 4) ^ nibbles[sum & 15];
    }
    return sum ^ 0xffffffffu;
}
