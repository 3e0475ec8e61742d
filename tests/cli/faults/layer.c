/*
 * A Vulkan layer that makes calls fail, as drivers do when a card resets or loses its connection.
 *
 *     RATTLEMAP_FAULT=CALL:N:RESULT   from its Nth call, CALL returns RESULT (a negative VkResult)
 *     RATTLEMAP_CALLS=FILE            at the end the layer writes lines "CALL COUNT" to FILE
 *     RATTLEMAP_LINGER=SECONDS        the process lasts so long after its libraries have destroyed their objects. A driver that
 *                                     still works then fails for certain, not by chance
 *
 * After the first result -4 all devices stay lost: every call that can report a lost device does so. A call on a device that does not exist (any more) ends the process with a message. The few types that a layer needs are declared here, so no headers have to be installed. Calls are forwarded
 * with six words, because 64-bit calling conventions pass integers and pointers in equal ways.
 */
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef uint64_t word;
typedef void (*function)(void);
typedef function (*get_function)(void *handle, const char *name);
typedef int32_t (*call)(void *handle, word, word, word, word, word);

enum { DEVICE_LOST = -4, INITIALIZATION_FAILED = -3, INSTANCE_LINK = 47, DEVICE_LINK = 48 };

/* VkLayerInstanceCreateInfo and VkLayerDeviceCreateInfo with function VK_LAYER_LINK_INFO (0), or another create info. */
struct info {
    int32_t type;
    const struct info *next;
    int32_t function;
    struct link *link;
};

/* VkLayerInstanceLink and VkLayerDeviceLink. `other` is for physical devices, or for the device. */
struct link {
    struct link *next;
    get_function instance;
    get_function other;
};

/* VkNegotiateLayerInterface */
struct interface {
    int32_t type;
    void *next;
    uint32_t version;
    get_function instance, device, physical_device;
};

/* Functions of the next layer for the latest instance. */
static get_function next_instance;
static void *latest_instance;

/* Devices in the order of creation. Objects of a device begin with the device's pointer to its table of functions. `handle` is NULL
 * for a destroyed device. */
enum { MOST_DEVICES = 64 };
static struct device {
    void *handle;
    get_function next;
} devices[MOST_DEVICES];
static int device_count;

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;

/* Calls that may fail, and whether they can report a lost device. */
#define CALLS(X) \
    X(QueueSubmit, 1) X(WaitForFences, 1) X(GetFenceStatus, 1) X(WaitSemaphores, 1) X(WaitSemaphoresKHR, 1) \
    X(GetSemaphoreCounterValue, 1) X(GetSemaphoreCounterValueKHR, 1) X(QueueWaitIdle, 1) X(DeviceWaitIdle, 1) \
    X(CreateComputePipelines, 0) X(CreateShaderModule, 0) X(CreatePipelineLayout, 0) X(CreateDescriptorSetLayout, 0) \
    X(CreateDescriptorPool, 0) X(AllocateDescriptorSets, 0) X(CreateBuffer, 0) X(AllocateMemory, 0) X(MapMemory, 0) \
    X(BindBufferMemory, 0) X(CreateCommandPool, 0) X(AllocateCommandBuffers, 0) X(BeginCommandBuffer, 0) \
    X(EndCommandBuffer, 0) X(ResetCommandPool, 0) X(CreateFence, 0) X(ResetFences, 0) X(CreateSemaphore, 0) \
    X(CreateQueryPool, 0)

enum {
#define NUMBER(name, reports_loss) name,
    CALLS(NUMBER) CreateDevice, CALL_COUNT
};

static const struct {
    const char *name;
    int reports_loss;
} calls[] = {
#define ROW(name, reports_loss) {"vk" #name, reports_loss},
    CALLS(ROW){"vkCreateDevice", 0},
};

/* Returns the device of an object. Call it under the lock. */
static struct device *device_of(void *object, const char *name) {
    for (int n = device_count - 1; n >= 0; n--)
        if (devices[n].handle && *(void **)devices[n].handle == *(void **)object) return &devices[n];
    fprintf(stderr, "layer of faults: %s on a device that does not exist\n", name);
    abort();
}

static int counts[CALL_COUNT];
static int is_lost;

/* Returns the result of a failing call; 0 if the call may proceed. Call it under the lock. */
static int32_t fault(int which) {
    int count = ++counts[which];
    const char *request = getenv("RATTLEMAP_FAULT"), *colon = request ? strchr(request, ':') : NULL;
    int32_t result = is_lost && calls[which].reports_loss ? DEVICE_LOST : 0;
    size_t length = colon ? (size_t)(colon - request) : 0;
    int from, code;
    if (colon && strlen(calls[which].name) == length && !strncmp(request, calls[which].name, length) &&
        sscanf(colon, ":%d:%d", &from, &code) == 2 && count >= from) {
        result = code;
        is_lost |= code == DEVICE_LOST;
    }
    return result;
}

static call driver(const struct device *device, const char *name) {
    return (call)device->next(device->handle, name);
}

/* A driver does not know that its device is lost. What it uses must not be destroyed, so the layer waits until it is idle. */
#define WRAPPER(name, reports_loss) \
    static int32_t wrapped_##name(void *handle, word a, word b, word c, word d, word e) { \
        pthread_mutex_lock(&lock); \
        const struct device device = *device_of(handle, "vk" #name); \
        int32_t result = fault(name); \
        pthread_mutex_unlock(&lock); \
        if (result == DEVICE_LOST) driver(&device, "vkDeviceWaitIdle")(device.handle, 0, 0, 0, 0, 0); \
        return result ? result : driver(&device, "vk" #name)(handle, a, b, c, d, e); \
    }
CALLS(WRAPPER)

static const struct info *link_of(const struct info *info, int type) {
    do info = info->next;
    while (info && !(info->type == type && info->function == 0));
    return info;
}

static int32_t create_instance(const struct info *create, const void *allocator, void **instance) {
    struct info *link = (struct info *)link_of(create, INSTANCE_LINK);
    if (!link) return INITIALIZATION_FAILED;
    get_function next = link->link->instance;
    link->link = link->link->next;
    int32_t (*create_next)(const void *, const void *, void **) = (void *)next(NULL, "vkCreateInstance");
    int32_t result = create_next(create, allocator, instance);
    if (!result) next_instance = next, latest_instance = *instance;
    return result;
}

static int32_t create_device(void *physical, const struct info *create, const void *allocator, void **device) {
    struct info *link = (struct info *)link_of(create, DEVICE_LINK);
    if (!link) return INITIALIZATION_FAILED;
    pthread_mutex_lock(&lock);
    int32_t result = device_count < MOST_DEVICES ? fault(CreateDevice) : INITIALIZATION_FAILED;
    pthread_mutex_unlock(&lock);
    if (result) return result;
    get_function instance = link->link->instance, next = link->link->other;
    link->link = link->link->next;
    int32_t (*create_next)(void *, const void *, const void *, void **) = (void *)instance(latest_instance, "vkCreateDevice");
    result = create_next(physical, create, allocator, device);
    if (result) return result;
    pthread_mutex_lock(&lock);
    devices[device_count++] = (struct device){*device, next};
    pthread_mutex_unlock(&lock);
    return 0;
}

static int32_t destroy_device(void *handle, word allocator, word a, word b, word c, word d) {
    if (!handle) return 0;
    pthread_mutex_lock(&lock);
    struct device *found = device_of(handle, "vkDestroyDevice");
    call next = driver(found, "vkDestroyDevice");
    found->handle = NULL;
    pthread_mutex_unlock(&lock);
    return next(handle, allocator, a, b, c, d);
}

static function device_function(void *device, const char *name);
static function instance_function(void *instance, const char *name);

static function own(const char *name) {
#define MATCH(call, reports_loss) \
    if (!strcmp(name, "vk" #call)) return (function)wrapped_##call;
    CALLS(MATCH)
    if (!strcmp(name, "vkCreateInstance")) return (function)create_instance;
    if (!strcmp(name, "vkCreateDevice")) return (function)create_device;
    if (!strcmp(name, "vkDestroyDevice")) return (function)destroy_device;
    if (!strcmp(name, "vkGetInstanceProcAddr")) return (function)instance_function;
    if (!strcmp(name, "vkGetDeviceProcAddr")) return (function)device_function;
    return NULL;
}

/* The layer has no function that the driver does not have. */
static function device_function(void *handle, const char *name) {
    pthread_mutex_lock(&lock);
    get_function next = device_of(handle, name)->next;
    pthread_mutex_unlock(&lock);
    function theirs = next(handle, name), mine = own(name);
    return theirs && mine ? mine : theirs;
}

static function instance_function(void *instance, const char *name) {
    function mine = own(name);
    return mine || !instance ? mine : next_instance(instance, name);
}

__attribute__((visibility("default"))) int32_t vkNegotiateLoaderLayerInterfaceVersion(struct interface *interface) {
    if (interface->version < 2) return INITIALIZATION_FAILED;
    interface->version = 2;
    interface->instance = instance_function;
    interface->device = device_function;
    interface->physical_device = NULL;
    return 0;
}

__attribute__((destructor)) static void write_calls(void) {
    const char *path = getenv("RATTLEMAP_CALLS"), *linger = getenv("RATTLEMAP_LINGER");
    FILE *file = path ? fopen(path, "w") : NULL;
    for (int n = 0; file && n < CALL_COUNT; n++) fprintf(file, "%s %d\n", calls[n].name, counts[n]);
    if (file) fclose(file);
    if (linger) sleep(atoi(linger));
}
