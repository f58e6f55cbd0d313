#pragma once
#include "ros/service.h"
